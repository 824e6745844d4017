//! The nearest point on a triangle mesh, by a bounding-volume hierarchy: how Gaussians with weights of their own find
//! the face that a face strategy rotates them with.

use glam::DVec3;
use skinsplat_core::scene::RestBody;

/// Faces per leaf.
const LEAF: usize = 4;

/// Nodes that can wait at once: one a level, and halving 2³² faces takes 32 levels.
const DEPTH: usize = 64;

/// A face and the barycentric coordinates of a point on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Face index.
    pub face: u32,
    /// Non-negative, summing to one.
    pub barycentric: [f64; 3],
}

struct Node {
    min: DVec3,
    max: DVec3,
    /// The range of `order` that the node covers.
    start: u32,
    end: u32,
    /// Index of the first child, the second follows the subtree of the first; 0 marks leaves.
    second_child: u32,
}

/// A hierarchy over the faces of a body in its rest pose.
pub struct NearestFace<'a> {
    vertices: &'a [DVec3],
    faces: &'a [[u32; 3]],
    nodes: Vec<Node>,
    order: Vec<u32>,
    /// The largest coordinate of a vertex.
    extent: f64,
}

/// The nearest point found so far.
struct Best {
    /// Squared distance.
    distance: f64,
    point: SurfacePoint,
    /// Boxes at a larger squared distance hold no face that is nearer, however distances were rounded.
    limit: f64,
    /// Bound on the rounding error of a distance.
    slack: f64,
}

impl Best {
    fn none(slack: f64) -> Self {
        // Stands where no distance is a number.
        let point = SurfacePoint { face: 0, barycentric: [1.0, 0.0, 0.0] };
        Self { distance: f64::INFINITY, point, limit: f64::INFINITY, slack }
    }

    fn offer(&mut self, distance: f64, face: u32, barycentric: [f64; 3]) {
        if distance < self.distance || (distance == self.distance && face < self.point.face) {
            let reach = distance.sqrt() + self.slack;
            *self =
                Self { distance, point: SurfacePoint { face, barycentric }, limit: reach * reach, ..*self };
        }
    }
}

impl<'a> NearestFace<'a> {
    /// Builds the hierarchy; `None` if the body has no faces. Cost: n log² n.
    pub fn new(body: &'a RestBody) -> Option<Self> {
        if body.faces.is_empty() {
            return None;
        }
        let order = (0..body.faces.len() as u32).collect();
        let extent = body.vertices.iter().fold(0.0, |most: f64, v| most.max(v.abs().max_element()));
        let nodes = Vec::new();
        let mut tree = Self { vertices: &body.vertices, faces: &body.faces, nodes, order, extent };
        let centroids: Vec<DVec3> =
            (0..body.faces.len() as u32).map(|f| tree.corners(f).iter().sum()).collect();
        tree.build(&centroids, 0, body.faces.len());
        Some(tree)
    }

    /// The point of the mesh nearest to `point`. Of faces at exactly the same distance the lowest index wins.
    ///
    /// A `guess`, such as the face that was nearest before the point moved a little, makes the search shorter and never
    /// changes what it finds.
    pub fn nearest(&self, point: DVec3, guess: Option<u32>) -> SurfacePoint {
        // A nearest point is a sum of three products of coordinates: some units in the last place of the largest.
        let mut best = Best::none(16.0 * f64::EPSILON * (self.extent + point.abs().max_element()));
        if let Some(face) = guess.filter(|&face| (face as usize) < self.faces.len()) {
            self.improve(point, face, &mut best);
        }
        let mut waiting = [(0.0, 0u32); DEPTH];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (distance, index) = waiting[count];
            if distance > best.limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.second_child == 0 {
                for &face in &self.order[node.start as usize..node.end as usize] {
                    self.improve(point, face, &mut best);
                }
                continue;
            }
            let child = |index: u32| (box_distance(&self.nodes[index as usize], point), index);
            let (a, b) = (child(index + 1), child(node.second_child));
            let (near, far) = if a.0 <= b.0 { (a, b) } else { (b, a) };
            for next in [far, near].into_iter().filter(|next| next.0 <= best.limit) {
                waiting[count] = next;
                count += 1;
            }
        }
        best.point
    }

    fn improve(&self, point: DVec3, face: u32, best: &mut Best) {
        let corners = self.corners(face);
        let barycentric = nearest_barycentric(corners, point);
        let on_face: DVec3 = corners.iter().zip(barycentric).map(|(&corner, b)| corner * b).sum();
        best.offer(on_face.distance_squared(point), face, barycentric);
    }

    fn corners(&self, face: u32) -> [DVec3; 3] {
        self.faces[face as usize].map(|vertex| self.vertices[vertex as usize])
    }

    /// Builds the subtree over `order[start..end]`, split at the median of its centroids along its longest side. The
    /// depth is the logarithm of the number of faces, so recursion is safe.
    fn build(&mut self, centroids: &[DVec3], start: usize, end: usize) {
        let corners = self.order[start..end].iter().flat_map(|&face| self.corners(face));
        let bounds = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (min, max) = corners.fold(bounds, |(min, max), corner| (min.min(corner), max.max(corner)));
        let index = self.nodes.len();
        self.nodes.push(Node { min, max, start: start as u32, end: end as u32, second_child: 0 });
        if end - start <= LEAF {
            return;
        }
        let sides = max - min;
        let axis = (0..3).max_by(|&a, &b| sides[a].total_cmp(&sides[b])).unwrap_or(0);
        let middle = (end - start) / 2;
        let key = |&face: &u32| (centroids[face as usize][axis], face);
        self.order[start..end].select_nth_unstable_by(middle, |a, b| {
            let ((a, face_a), (b, face_b)) = (key(a), key(b));
            a.total_cmp(&b).then(face_a.cmp(&face_b))
        });
        self.build(centroids, start, start + middle);
        self.nodes[index].second_child = self.nodes.len() as u32;
        self.build(centroids, start + middle, end);
    }
}

/// Squared distance from a point to a box, 0 inside.
fn box_distance(node: &Node, point: DVec3) -> f64 {
    point.clamp(node.min, node.max).distance_squared(point)
}

/// Barycentric coordinates of the point of a triangle nearest to `p`, by the Voronoi region that `p` lies in (Ericson,
/// Real-Time Collision Detection, §5.1.5). Exactly (1, 0, 0) and the like where a corner is nearest, also for triangles
/// without area.
fn nearest_barycentric([a, b, c]: [DVec3; 3], p: DVec3) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let (ap, bp, cp) = (p - a, p - b, p - c);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let on_ab = d1 * d4 - d3 * d2;
    if on_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let on_ac = d5 * d2 - d1 * d6;
    if on_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let on_bc = d3 * d6 - d5 * d4;
    if on_bc <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let total = on_ab + on_ac + on_bc;
    let (v, w) = (on_ac / total, on_ab / total);
    [1.0 - v - w, v, w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::scene::{Skeleton, SkinWeights};

    fn body(vertices: Vec<DVec3>, faces: Vec<[u32; 3]>) -> RestBody {
        let skeleton =
            Skeleton::from_joint_positions(vec!["root".into()], vec![None], &[DVec3::ZERO]).unwrap();
        let weights = SkinWeights::from_rows(vertices.iter().map(|_| [(0, 1.0)]), 1).unwrap();
        RestBody { skeleton, vertices, faces, weights, uv: None, pose_directions: Vec::new() }
    }

    /// A wavy sheet with a few degenerate faces.
    fn sheet(n: u32) -> RestBody {
        let at = |i: u32, j: u32| {
            let (x, y) = (f64::from(i) / 7.0, f64::from(j) / 5.0);
            DVec3::new(x, y, (x * 3.0).sin() * (y * 2.0).cos() * 0.3)
        };
        let vertices = (0..n * n).map(|k| at(k / n, k % n)).collect();
        let mut faces = Vec::new();
        for i in 0..n - 1 {
            for j in 0..n - 1 {
                let v = i * n + j;
                faces.extend([[v, v + 1, v + n], [v + 1, v + n + 1, v + n], [v, v, v + 1]]);
            }
        }
        body(vertices, faces)
    }

    #[test]
    fn agrees_with_trying_every_face() {
        let body = sheet(12);
        let tree = NearestFace::new(&body).unwrap();
        for k in 0..500u32 {
            let t = f64::from(k);
            let point = DVec3::new((t * 0.37).sin() * 2.0, (t * 0.73).cos() * 2.0, (t * 0.11).sin());
            let best = of_all(&tree, point);
            assert_eq!(tree.nearest(point, None), best);
            for guess in [0, k % body.faces.len() as u32, best.face, u32::MAX] {
                assert_eq!(tree.nearest(point, Some(guess)), best, "{guess}");
            }
        }
    }

    fn of_all(tree: &NearestFace<'_>, point: DVec3) -> SurfacePoint {
        let mut best = Best::none(0.0);
        (0..tree.faces.len() as u32).for_each(|face| tree.improve(point, face, &mut best));
        best.point
    }

    proptest::proptest! {
        /// On lattices many faces are equally near, up to rounding, and boxes touch the faces in them.
        #[test]
        fn a_guess_changes_nothing(
            steps in proptest::collection::vec((0u32..16, 0u32..16, -2i32..3), 1..40),
            scale in 0.1f64..10.0,
            guess in 0u32..700,
        ) {
            let mut body = sheet(16);
            body.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x * 0.7, v.y * 0.5, 0.0).round() * scale);
            let tree = NearestFace::new(&body).unwrap();
            for (x, y, z) in steps {
                let point = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * (0.5 * scale / 3.0);
                let best = of_all(&tree, point);
                proptest::prop_assert_eq!(tree.nearest(point, None), best);
                proptest::prop_assert_eq!(tree.nearest(point, Some(guess)), best);
            }
        }
    }

    #[test]
    fn coordinates_that_overflow_still_name_a_face() {
        let far = body(vec![DVec3::X * 1e160, DVec3::Y * 1e300, DVec3::splat(-1e200)], vec![[0, 1, 2]]);
        for point in [DVec3::ZERO, DVec3::splat(1e170), DVec3::splat(f64::NAN)] {
            assert_eq!(NearestFace::new(&far).unwrap().nearest(point, None).face, 0);
        }
    }

    #[test]
    fn vertices_go_to_their_lowest_face() {
        let body = sheet(9);
        let tree = NearestFace::new(&body).unwrap();
        for (v, &point) in body.vertices.iter().enumerate() {
            let lowest = body.faces.iter().position(|f| f.contains(&(v as u32))).unwrap();
            assert_eq!(tree.nearest(point, None).face as usize, lowest);
        }
    }

    #[test]
    fn the_nearest_point_is_on_the_triangle_and_no_corner_is_nearer() {
        let triangle = [DVec3::ZERO, DVec3::new(1.0, 0.2, 0.0), DVec3::new(0.3, 0.9, 0.1)];
        for k in 0..1000u32 {
            let t = f64::from(k);
            let p = DVec3::new((t * 1.3).sin() * 2.0, (t * 0.7).sin() * 2.0, (t * 2.1).cos());
            let b = nearest_barycentric(triangle, p);
            assert!((b.iter().sum::<f64>() - 1.0).abs() < 1e-12 && b.iter().all(|&x| x >= -1e-12));
            let q: DVec3 = triangle.iter().zip(b).map(|(&v, x)| v * x).sum();
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let other = triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v;
                    assert!(q.distance(p) <= other.distance(p) + 1e-12);
                }
            }
        }
    }
}
