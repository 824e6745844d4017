//! Implicit surface to triangle mesh: surface nets on an octree's leaves, seen through lenses that magnify fine parts,
//! then relaxed on the surface into well-shaped triangles.
//!
//! The mesh is closed and consistently oriented: every grid edge that crosses the surface gives one quad between the four
//! cells around it.

use super::cell::{edge, mean_crossing, sheets_of_all_cases};
use super::field::Field;
use glam::DVec3;
use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::SceneError;

/// A place that is sampled more finely, smoothly falling off around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    /// Centre, metres.
    pub(super) centre: DVec3,
    /// Half width of the magnified region, metres.
    pub(super) radius: f64,
    /// Samples per metre at the centre, relative to those far away.
    pub(super) power: f64,
}

/// The map from the space of the uniform grid to the world: the identity minus convex gradients, hence one-to-one; it
/// never enlarges a distance.
struct Warp {
    cell: f64,
    /// Lenses with their centre in grid space (metres) and the radius there.
    lenses: Vec<Lens>,
}

impl Warp {
    fn new(cell: f64, lenses: &[Lens]) -> Self {
        let mut warp = Self { cell, lenses: lenses.to_vec() };
        for lens in &mut warp.lenses {
            lens.radius *= lens.power;
        }
        // Each centre must map to where it was asked for; lenses shift each other only slightly, so this settles.
        for _ in 0..20 {
            let shifts: Vec<DVec3> = warp.lenses.iter().map(|l| warp.shift(l.centre)).collect();
            for ((lens, asked), shift) in warp.lenses.iter_mut().zip(lenses).zip(shifts) {
                lens.centre = asked.centre + shift;
            }
        }
        warp
    }

    fn shift(&self, point: DVec3) -> DVec3 {
        let one = |lens: &Lens| {
            let offset = point - lens.centre;
            let ratio = offset.length_squared() / (lens.radius * lens.radius);
            let falloff = (1.0 + ratio).sqrt();
            offset * ((1.0 - 1.0 / lens.power) / falloff)
        };
        self.lenses.iter().map(one).sum()
    }

    /// World position of a point in units of cells.
    fn world(&self, grid: DVec3) -> DVec3 {
        let point = grid * self.cell;
        point - self.shift(point)
    }

    /// No point is moved farther than this, metres.
    fn largest_shift(&self) -> f64 {
        self.lenses.iter().map(|l| l.radius * (1.0 - 1.0 / l.power)).sum()
    }
}

type Cell = [i32; 3];

/// Cells per side of an octree leaf.
const LEAF: i32 = 4;
const SIDE: usize = LEAF as usize + 1;

/// A vertex of the net: one per cell and sheet of the surface in it.
struct NetVertex {
    cell: Cell,
    /// A bit per edge of the cell that the sheet crosses.
    sheet: u16,
    /// Index of the octree leaf that the cell belongs to.
    leaf: usize,
    position: DVec3,
}

/// A triangle mesh, counter-clockwise seen from outside.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    pub(super) vertices: Vec<DVec3>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Index of the field's part that is nearest, per vertex.
    pub(super) parts: Vec<usize>,
}

/// The field around one octree leaf.
struct Region<'a> {
    whole: &'a Field,
    local: Field,
    centre: DVec3,
    radius: f64,
}

impl<'a> Region<'a> {
    fn new(whole: &'a Field, warp: &Warp, leaf: Cell) -> Self {
        let centre = warp.world(grid_point(leaf) + f64::from(LEAF) / 2.0);
        // Half the diagonal, and two cells for vertices that slide out of the leaf.
        let radius = warp.cell * (f64::from(LEAF) * 3f64.sqrt() / 2.0 + 2.0);
        Self { whole, local: whole.near(centre, radius), centre, radius }
    }

    fn field_at(&self, point: DVec3) -> &Field {
        if (point - self.centre).length() < self.radius { &self.local } else { self.whole }
    }
}

/// Meshes the zero level of a field, which must be a sphere in all but shape, with cells of at most `cell` metres, finer
/// under the lenses.
///
/// Where two fingers nearly touch, cells can join what should be apart; then finer cells are tried.
///
/// # Errors
/// If no attempt gives a sphere; the field is named `rig.edge`.
pub(super) fn mesh(field: &Field, cell: f64, lenses: &[Lens]) -> Result<Mesh, SceneError> {
    let mut attempts = (0..ATTEMPTS).map(|k| attempt(field, cell * portable::powi(FINER, k), lenses));
    attempts.find(Mesh::is_sphere).ok_or_else(|| {
        SceneError::new("rig.edge", format!("{cell} m gives a surface with handles"), "a shorter edge")
    })
}

/// How often, and by which factor each time, cells are made smaller.
const ATTEMPTS: i32 = 8;
const FINER: f64 = 0.94;

impl Mesh {
    /// Closed, consistently oriented, in one piece and without handles: every edge is used once in each direction, and
    /// V - E + F = 2.
    fn is_sphere(&self) -> bool {
        let directed = |f: &[u32; 3]| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])];
        let mut edges: Vec<(u32, u32)> = self.faces.iter().flat_map(directed).collect();
        let mut reversed: Vec<(u32, u32)> = edges.iter().map(|&(a, b)| (b, a)).collect();
        edges.sort_unstable();
        reversed.sort_unstable();
        let once = edges.windows(2).all(|pair| pair[0] != pair[1]);
        once && edges == reversed && self.vertices.len() + self.faces.len() == edges.len() / 2 + 2
    }
}

fn attempt(field: &Field, cell: f64, lenses: &[Lens]) -> Mesh {
    let warp = Warp::new(cell, lenses);
    let leaves = leaves(field, &warp);
    let regions: Vec<Region<'_>> = leaves.par_iter().map(|&leaf| Region::new(field, &warp, leaf)).collect();
    let sheets = sheets_of_all_cases();
    let nets: Vec<(Vec<NetVertex>, Vec<Crossing>)> = leaves
        .par_iter()
        .enumerate()
        .map(|(i, &leaf)| net_in_leaf(&regions[i].local, &warp, &sheets, leaf, i))
        .collect();
    let (mut net, mut crossings) = (Vec::new(), Vec::new());
    for (vertices, edges) in nets {
        net.extend(vertices);
        crossings.extend(edges);
    }
    net.sort_by_key(|v| (v.cell, v.sheet));
    let quads: Vec<[u32; 4]> = crossings.iter().filter_map(|edge| edge.quad(&net)).collect();
    let vertices = relaxed(&regions, &net, &quads);
    let part = |(vertex, &position): (&NetVertex, &DVec3)| {
        regions[vertex.leaf].field_at(position).nearest_part(position)
    };
    Mesh {
        parts: net.par_iter().zip(&vertices).map(part).collect(),
        faces: split(&vertices, &quads),
        vertices,
    }
}

/// Octree leaves that may hold surface, in a fixed order.
fn leaves(field: &Field, warp: &Warp) -> Vec<Cell> {
    let (low, high) = field.bounds();
    let centre = (low + high) / 2.0;
    let half = (high - low).max_element() / 2.0 + warp.largest_shift() + warp.cell;
    let mut size = LEAF;
    while f64::from(size) * warp.cell < 2.0 * half {
        size *= 2;
    }
    let corner = (centre / warp.cell - f64::from(size) / 2.0).floor();
    let mut stack = vec![([corner.x as i32, corner.y as i32, corner.z as i32], size)];
    let mut leaves = Vec::new();
    while let Some((corner, size)) = stack.pop() {
        let middle = grid_point(corner) + f64::from(size) / 2.0;
        let half_diagonal = f64::from(size) * warp.cell * 3f64.sqrt() / 2.0;
        if field.distance(warp.world(middle)).abs() > half_diagonal {
            continue;
        }
        if size == LEAF {
            leaves.push(corner);
            continue;
        }
        let half = size / 2;
        stack.extend(
            (0..8).map(|c| (std::array::from_fn(|axis| corner[axis] + half * (c >> axis & 1)), half)),
        );
    }
    leaves
}

fn grid_point(cell: Cell) -> DVec3 {
    DVec3::from_array(cell.map(f64::from))
}

/// A grid edge that crosses the surface.
struct Crossing {
    lower: Cell,
    axis: usize,
    /// True if its lower end is inside.
    lower_inside: bool,
}

impl Crossing {
    /// The vertices of the four cells around the edge, counter-clockwise seen from outside.
    fn quad(&self, net: &[NetVertex]) -> Option<[u32; 4]> {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let mut quad = [0; 4];
        for (slot, (back_u, back_v)) in [(1, 1), (0, 1), (0, 0), (1, 0)].into_iter().enumerate() {
            let mut cell = self.lower;
            cell[u] -= back_u;
            cell[v] -= back_v;
            let crossed = edge(self.axis, back_u as usize, back_v as usize);
            let first = net.partition_point(|n| n.cell < cell);
            let mut here = net[first..].iter().take_while(|n| n.cell == cell);
            let group = here.position(|n| n.sheet >> crossed & 1 == 1)?;
            quad[slot] = (first + group) as u32;
        }
        if !self.lower_inside {
            quad.reverse();
        }
        Some(quad)
    }
}

fn net_in_leaf(
    field: &Field,
    warp: &Warp,
    sheets: &[Vec<u16>],
    leaf: Cell,
    leaf_index: usize,
) -> (Vec<NetVertex>, Vec<Crossing>) {
    let index = |p: [usize; 3]| p[0] + SIDE * (p[1] + SIDE * p[2]);
    let positions = |i: usize| [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)];
    let global = |p: [usize; 3]| -> Cell { std::array::from_fn(|axis| leaf[axis] + p[axis] as i32) };
    let value = |i| field.distance(warp.world(grid_point(global(positions(i)))));
    let values: Vec<f64> = (0..SIDE.pow(3)).map(value).collect();
    let (mut vertices, mut crossings) = (Vec::new(), Vec::new());
    for cell in (0..values.len()).map(positions).filter(|p| p.iter().all(|&c| c + 1 < SIDE)) {
        let corner_at = |c: usize| std::array::from_fn(|axis| cell[axis] + (c >> axis & 1));
        let corners: [f64; 8] = std::array::from_fn(|c| values[index(corner_at(c))]);
        let inside = (0..8).fold(0u8, |mask, c| mask | u8::from(corners[c] < 0.0) << c);
        if inside == 0 || inside == u8::MAX {
            continue;
        }
        for &sheet in &sheets[usize::from(inside)] {
            let position = warp.world(grid_point(global(cell)) + mean_crossing(&corners, sheet));
            vertices.push(NetVertex { cell: global(cell), sheet, leaf: leaf_index, position });
        }
        let lower_inside = inside & 1 == 1;
        for axis in (0..3).filter(|axis| (inside >> (1 << axis) & 1 == 1) != lower_inside) {
            crossings.push(Crossing { lower: global(cell), axis, lower_inside });
        }
    }
    (vertices, crossings)
}

const RELAXATIONS: usize = 12;

/// Vertices moved towards the mean of their neighbours along the surface, and back onto it by Newton steps: one per round,
/// and two at the end.
fn relaxed(regions: &[Region<'_>], net: &[NetVertex], quads: &[[u32; 4]]) -> Vec<DVec3> {
    let neighbours = quad_neighbours(net.len(), quads);
    let project = |i: usize, position: DVec3| {
        let here = regions[net[i].leaf].field_at(position).sample(position);
        let slope = here.gradient.length_squared();
        let step = if slope > 1e-2 { here.gradient * (here.distance / slope) } else { DVec3::ZERO };
        (position - step, here.gradient.normalize_or_zero())
    };
    let mut state: Vec<(DVec3, DVec3)> =
        net.par_iter().enumerate().map(|(i, vertex)| project(i, vertex.position)).collect();
    for _ in 0..RELAXATIONS {
        let moved = |(i, around): (usize, &Vec<u32>)| {
            let (vertex, normal) = state[i];
            let mean = around.iter().map(|&k| state[k as usize].0).sum::<DVec3>() / around.len() as f64;
            let step = (mean - vertex) * 0.6;
            project(i, vertex + step - normal * step.dot(normal))
        };
        state = neighbours.par_iter().enumerate().map(moved).collect();
    }
    let polished = |(i, &(vertex, _)): (usize, &(DVec3, DVec3))| project(i, project(i, vertex).0).0;
    state.par_iter().enumerate().map(polished).collect()
}

fn quad_neighbours(count: usize, quads: &[[u32; 4]]) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); count];
    for quad in quads {
        for k in 0..4 {
            // Each edge is seen once in this direction: two quads traverse it oppositely.
            neighbours[quad[k] as usize].push(quad[(k + 1) % 4]);
        }
    }
    neighbours
}

/// Two triangles per quad, along the diagonal that leaves the larger smallest angle.
fn split(vertices: &[DVec3], quads: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let smallest_angle = |face: [u32; 3]| {
        let p = face.map(|i| vertices[i as usize]);
        let angle = |k: usize| {
            let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            let cosine = u.dot(v) / (u.length_squared() * v.length_squared()).sqrt();
            portable::acos(cosine.clamp(-1.0, 1.0))
        };
        (0..3).map(angle).fold(4.0, f64::min)
    };
    let triangles = |&[a, b, c, d]: &[u32; 4]| {
        let (one, other) = ([[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]);
        let worst = |pair: [[u32; 3]; 2]| pair.map(smallest_angle).into_iter().fold(4.0, f64::min);
        if worst(one) >= worst(other) { one } else { other }
    };
    quads.iter().flat_map(triangles).collect()
}
