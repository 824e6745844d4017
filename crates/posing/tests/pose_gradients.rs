//! The adjoint of posing with respect to the pose against differences of posing itself, for every strategy.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::{DVec3, Mat3, Vec3};
use skinsplat_core::math::average::{Solver, average};
use skinsplat_core::scene::{
    Avatar, AvatarGradient, Binding, BodyGradient, OwnedPosed, Pose, PoseGradient, PosedBody, PosedGradient,
    RestBody,
};
use skinsplat_posing::{BoundAvatar, Gradients, PRESETS, PoseOptions, Poser, PosingError, Strategy, pose};

const N: usize = 48;

/// Below this relative gap of Σ w q qᵀ a Gaussian's average is near a tie, and the difference of fourth order over a step of
/// 0.012 no longer tells its derivative.
const LEAST_GAP: f64 = 0.25;

/// A loss of every Gaussian: products of what is drawn with fixed numbers; of view frames F, through the direction
/// `normalize(F d)` in which SH are read along fixed d, since nothing else is read of them.
struct Loss {
    of: PosedGradient,
    /// Per Gaussian: the direction d, and the factor of the direction it becomes.
    read: Vec<(Vec3, Vec3)>,
}

impl Loss {
    fn new(posed: &OwnedPosed, seed: u64) -> Self {
        let mut noise = rig::Noise(seed ^ 1234);
        let mut of = PosedGradient::default();
        of.reset(&posed.as_posed());
        of.means.iter_mut().for_each(|g| *g = noise.vector().as_vec3());
        for g in &mut of.factors {
            let [a, b, c] = [0; 3].map(|_| noise.vector().as_vec3() * 100.0);
            *g = Mat3::from_cols(a, b, c);
        }
        of.sh.iter_mut().for_each(|g| *g = noise.vector().as_vec3().to_array());
        let mut unit = || noise.vector().as_vec3().normalize();
        let read = (0..posed.len()).map(|_| (unit(), unit())).collect();
        Self { of, read }
    }

    fn of_gaussian(&self, posed: &OwnedPosed, i: usize) -> f64 {
        let dot =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
        let count = (posed.sh_degree + 1).pow(2);
        let sh = i * count..(i + 1) * count;
        let (way, factor) = self.read[i];
        let direction = posed.view_frames.as_ref().map_or(0.0, |frames| {
            let turned = frames[i].as_dmat3() * way.as_dvec3();
            turned.normalize().dot(factor.as_dvec3())
        });
        dot(posed.means[i].as_ref(), self.of.means[i].as_ref())
            + dot(&posed.factors[i].to_cols_array(), &self.of.factors[i].to_cols_array())
            + dot(posed.sh[sh.clone()].as_flattened(), self.of.sh[sh].as_flattened())
            + direction
    }

    /// The derivatives for the Gaussians that are `kept`, as a renderer hands them over.
    fn upstream(&self, posed: &OwnedPosed, kept: &[bool]) -> PosedGradient {
        let mut of = self.of.clone();
        let count = (posed.sh_degree + 1).pow(2);
        for i in 0..posed.len() {
            if !kept[i] {
                (of.means[i], of.factors[i]) = (Vec3::ZERO, Mat3::ZERO);
                of.sh[i * count..(i + 1) * count].fill([0.0; 3]);
            }
            if let (true, Some(frames)) = (kept[i], &posed.view_frames) {
                let (way, factor) = self.read[i];
                let turned = frames[i] * way;
                let unit = turned.normalize();
                let own = (factor - unit * unit.dot(factor)) / turned.length();
                of.view_frames[i] = Mat3::from_cols(own * way.x, own * way.y, own * way.z);
            }
        }
        of
    }
}

/// What is differentiated: the vectors of [`Pose::turned`], then the translation.
fn moved(pose: &Pose, coordinate: usize, step: f64) -> Pose {
    let mut vectors = [DVec3::ZERO; rig::JOINTS + 1];
    vectors[coordinate / 3][coordinate % 3] = step;
    pose.turned(&vectors[..rig::JOINTS], vectors[rig::JOINTS])
}

fn entries(gradient: &PoseGradient) -> Vec<f64> {
    gradient.rotations.iter().chain([&gradient.translation]).flat_map(|v| v.to_array()).collect()
}

/// A bound avatar in a pose.
struct Case<'a> {
    avatar: Avatar,
    bound: BoundAvatar,
    rest: &'a RestBody,
    at: &'a Pose,
}

impl<'a> Case<'a> {
    fn new(avatar: Avatar, rest: &'a RestBody, at: &'a Pose) -> Self {
        let bound = BoundAvatar::new(&avatar, rest).unwrap();
        Self { avatar, bound, rest, at }
    }

    fn posed(&self, at: &Pose, strategy: &Strategy) -> OwnedPosed {
        pose(&self.bound, &PosedBody::new(self.rest, at).unwrap(), strategy).unwrap()
    }

    fn gradient(&self, strategy: &Strategy, upstream: &PosedGradient) -> PoseGradient {
        let body = PosedBody::new(self.rest, self.at).unwrap();
        let mut of_body = BodyGradient::default();
        of_body.reset(body.joints.len());
        let into = Gradients { body: Some(&mut of_body), ..Gradients::default() };
        let (options, gaussians) = (PoseOptions::default(), &self.avatar.gaussians);
        Poser::new().backward(&self.bound, &body, strategy, &options, gaussians, upstream, into).unwrap();
        body.pose_gradient(self.at, &of_body).unwrap()
    }

    /// Per coordinate and Gaussian: the central differences of fourth order, and those of second.
    fn differences(&self, strategy: &Strategy, loss: &Loss) -> Vec<[Vec<f64>; 2]> {
        let coordinates = 3 * rig::JOINTS + 3;
        let slope = |coordinate: usize, h: f64| {
            let [up, down] = [h, -h].map(|h| self.posed(&moved(self.at, coordinate, h), strategy));
            let of = |i: usize| (loss.of_gaussian(&up, i) - loss.of_gaussian(&down, i)) / (2.0 * h);
            (0..self.bound.len()).map(of).collect::<Vec<f64>>()
        };
        let both = |coordinate: usize| {
            let (half, full) = (slope(coordinate, 0.006), slope(coordinate, 0.012));
            let fourth = half.iter().zip(&full).map(|(half, full)| (4.0 * half - full) / 3.0).collect();
            [fourth, full]
        };
        (0..coordinates).map(both).collect()
    }

    /// Gaussians whose average is near a tie, at themselves or at a corner of their face.
    fn near_ties(&self) -> Vec<bool> {
        let body = PosedBody::new(self.rest, self.at).unwrap();
        let gap = |row: (&[u16], &[f32])| {
            let quats: Vec<_> = row.0.iter().map(|&j| body.joints[usize::from(j)].rotation).collect();
            let quats: Vec<_> = quats.iter().map(|q| [q.w, q.x, q.y, q.z]).collect();
            let weights: Vec<f64> = row.1.iter().map(|&w| f64::from(w)).collect();
            average(&quats, &weights, Solver::Eigen).unwrap().gap
        };
        let near = |i: usize| {
            let of_own = match &self.avatar.binding {
                Binding::Vertex(weights) => gap(weights.row(i)),
                Binding::Static | Binding::Face(_) => 1.0,
            };
            let (face, barycentric) = self.bound.face(i).unwrap();
            let corners = self.rest.faces[face as usize];
            let of_corners = corners.iter().map(|&v| gap(self.rest.weights.row(v as usize)));
            let cut = barycentric.map(|b| f64::from(b.max(0.0)));
            let sum: f64 = cut.iter().sum();
            let mixed = self.rest.weights_at(face, cut.map(|b| b / sum));
            let (joints, weights): (Vec<u16>, Vec<f32>) = mixed.iter().map(|&(j, w)| (j as u16, w)).unzip();
            of_corners.chain([of_own, gap((&joints, &weights))]).fold(1.0, f64::min) < LEAST_GAP
        };
        (0..self.bound.len()).map(near).collect()
    }
}

/// Largest error of an entry, over the root of the sum of squares of what the Gaussians ask for. The difference is of the `f32` forward pass: rounding of the outputs
/// over the step leaves 2e-5; curvature adds to it where faces are narrow and averages near ties, up to what makes a Gaussian
/// count as next to a choice.
const TOLERANCE: f64 = 5e-4;

/// How many Gaussians were left out, and why.
#[derive(Debug, Default)]
struct LeftOut {
    ties: usize,
    choices: usize,
    of: usize,
    /// Strategies whose gradient is not the difference.
    wrong: Vec<String>,
}

impl LeftOut {
    /// Most Gaussians were looked at, and all is right.
    fn assert(&self, name: &str) {
        assert!(self.wrong.is_empty(), "{name}: {:#?}", self.wrong);
        assert!(self.ties * 4 < self.of && self.choices * 7 < self.of, "{name}: {self:?}");
    }
}

/// Compares with differences, summed over Gaussians. Those near a tie of the average are left out by their gap, and those within a
/// step of a place where a strategy chooses by that differences of second and fourth order disagree.
fn check(case: &Case<'_>, strategy: &Strategy, seed: u64, left_out: &mut LeftOut) {
    let posed = case.posed(case.at, strategy);
    let loss = Loss::new(&posed, seed);
    let differences = case.differences(strategy, &loss);
    let n = case.bound.len();
    let size_of = |i: usize| differences.iter().map(|[fourth, _]| fourth[i].powi(2)).sum::<f64>().sqrt();
    let typical = (0..n).map(size_of).sum::<f64>() / n as f64;
    let ties = case.near_ties();
    let chooses = |i: usize| {
        let size = size_of(i).max(typical);
        differences.iter().any(|[fourth, full]| (fourth[i] - full[i]).abs() > 1e-3 * size)
    };
    let kept: Vec<bool> = (0..n).map(|i| !ties[i] && !chooses(i)).collect();
    left_out.of += n;
    left_out.ties += ties.iter().filter(|&&tie| tie).count();
    left_out.choices += (0..n).filter(|&i| !ties[i] && !kept[i]).count();
    let sum = |[fourth, _]: &[Vec<f64>; 2]| (0..n).filter(|&i| kept[i]).map(|i| fourth[i]).sum::<f64>();
    let expected: Vec<f64> = differences.iter().map(sum).collect();
    let found = entries(&case.gradient(strategy, &loss.upstream(&posed, &kept)));
    // What Gaussians ask for may cancel, their errors do not.
    let size = (0..n).filter(|&i| kept[i]).map(|i| size_of(i).powi(2)).sum::<f64>().sqrt();
    let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size;
    if worst > TOLERANCE {
        left_out.wrong.push(format!("{strategy}: off by {worst:e}"));
    }
}

fn avatars(rest: &RestBody, seed: u64) -> [Avatar; 2] {
    [rig::on_vertices(rest, N, seed), rig::on_faces(rest, N, seed)]
}

#[test]
fn every_preset_follows_the_pose() {
    let rest = rig::body();
    for (seed, preset) in (0..).zip(PRESETS) {
        let mut left_out = LeftOut::default();
        for bend in [0.3, 0.8] {
            let at = rig::bent(&rest, 8 + seed, bend);
            for avatar in avatars(&rest, seed) {
                check(&Case::new(avatar, &rest, &at), &preset.strategy, seed, &mut left_out);
            }
        }
        left_out.assert(preset.id);
    }
}

#[test]
fn every_choice_of_every_axis_follows_the_pose() {
    let rest = rig::body();
    let mut left_out = LeftOut::default();
    for (seed, strategy) in (0..).zip(rig::strategies()) {
        let at = rig::bent(&rest, 4 + seed, 0.7);
        for avatar in avatars(&rest, seed) {
            check(&Case::new(avatar, &rest, &at), &strategy, seed, &mut left_out);
        }
    }
    left_out.assert("every choice");
}

/// Joints that scale are followed through their rotations.
#[test]
fn every_choice_follows_joints_that_scale() {
    let rest = rig::body();
    let mut left_out = LeftOut::default();
    for (seed, strategy) in (0..).zip(rig::strategies()) {
        let at = rig::scaled(&rig::bent(&rest, 4 + seed, 0.7), 6);
        for avatar in avatars(&rest, seed) {
            check(&Case::new(avatar, &rest, &at), &strategy, seed, &mut left_out);
        }
    }
    left_out.assert("every choice");
}

/// Every number of both gradients, with and without the other, for any number of threads.
#[test]
fn any_number_of_threads_gives_the_same_bits_whatever_is_asked_for() {
    let rest = rig::body();
    let at = rig::bent(&rest, 5, 0.9);
    let body = PosedBody::new(&rest, &at).unwrap();
    let pools = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    for avatar in [rig::on_vertices(&rest, 5_000, 6), rig::on_faces(&rest, 5_000, 6)] {
        let case = Case::new(avatar, &rest, &at);
        for preset in PRESETS {
            let posed = case.posed(&at, &preset.strategy);
            let upstream = Loss::new(&posed, 1).upstream(&posed, &vec![true; posed.len()]);
            let run = |with_avatar: bool, with_body: bool| {
                let (mut of_avatar, mut of_body) = (AvatarGradient::default(), BodyGradient::default());
                of_avatar.reset(&case.avatar.gaussians, matches!(case.avatar.binding, Binding::Face(_)));
                of_body.reset(body.joints.len());
                let into = Gradients {
                    avatar: with_avatar.then_some(&mut of_avatar),
                    body: with_body.then_some(&mut of_body),
                };
                let (options, gaussians) = (PoseOptions::default(), &case.avatar.gaussians);
                Poser::new()
                    .backward(&case.bound, &body, &preset.strategy, &options, gaussians, &upstream, into)
                    .unwrap();
                (of_avatar, of_body)
            };
            let (of_avatar, of_body) = pools[0].install(|| run(true, true));
            assert!(
                of_body.torques.iter().any(|t| *t != DVec3::ZERO)
                    || of_body.linear.iter().any(|m| *m != glam::DMat3::ZERO)
                    || !of_body.vertices.is_empty()
            );
            assert!(
                pools[1].install(|| run(true, true)) == (of_avatar.clone(), of_body.clone()),
                "{}",
                preset.id
            );
            assert!(run(true, false).0 == of_avatar, "{}", preset.id);
            assert!(run(false, true).1 == of_body, "{}", preset.id);
        }
    }
}

#[test]
fn gradients_of_another_body_are_refused() {
    let rest = rig::body();
    let at = rig::bent(&rest, 5, 0.5);
    let case = Case::new(rig::on_faces(&rest, N, 1), &rest, &at);
    let strategy = PRESETS[0].strategy;
    let posed = case.posed(&at, &strategy);
    let mut upstream = Loss::new(&posed, 1).upstream(&posed, &[true; N]);
    let body = PosedBody::new(&rest, &at).unwrap();
    let attempt = |upstream: &PosedGradient, joints: usize| {
        let mut of_body = BodyGradient::default();
        of_body.reset(joints);
        let into = Gradients { body: Some(&mut of_body), ..Gradients::default() };
        let (options, gaussians) = (PoseOptions::default(), &case.avatar.gaussians);
        match Poser::new().backward(&case.bound, &body, &strategy, &options, gaussians, upstream, into) {
            Err(PosingError::Scene(error)) => error.field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(attempt(&upstream, rig::JOINTS - 1), "gradient of the joints");
    upstream.view_frames = vec![Mat3::ZERO; N - 1];
    assert_eq!(attempt(&upstream, rig::JOINTS), "gradient of the view frames");
}
