//! Seeded batches: hard blends for the table of errors, avatars for the timing.

use super::batch::{Batch, COEFFICIENTS, Gaussian};
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::math::{Quaternion, dot4, portable, rotation};

/// Random numbers as the cases need them.
struct Draw(SplitMix64);

impl Draw {
    /// In \[0, 1).
    fn unit(&mut self) -> f32 {
        self.0.unit_f32()
    }

    /// In \[-1, 1).
    fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    fn vector(&mut self, size: f32) -> [f32; 3] {
        [0; 3].map(|_| size * self.signed())
    }

    /// Uniform over the rotations: a point in the ball of R⁴, normalised.
    fn rotation(&mut self) -> Quaternion<f32> {
        loop {
            let q = [0; 4].map(|_| self.signed());
            let square = dot4(q, q);
            if square > 0.01 && square < 1.0 {
                return unit(q);
            }
        }
    }

    /// A rotation by at most `degrees` about a random axis.
    fn turn(&mut self, degrees: f32) -> Quaternion<f32> {
        let [_, x, y, z] = self.rotation();
        let axis = unit([0.0, x, y, z]);
        let half = f64::from(self.unit() * degrees.to_radians()) / 2.0;
        let (sine, cosine) = (portable::sin(half) as f32, portable::cos(half) as f32);
        unit([cosine, sine * axis[1], sine * axis[2], sine * axis[3]])
    }

    fn gaussian(&mut self) -> Gaussian {
        let scale = [0; 3].map(|_| 0.002 + 0.03 * self.unit() * self.unit());
        Gaussian { mean: self.vector(1.0), rotation: self.rotation(), scale }
    }

    fn sh(&mut self) -> [[f32; 3]; COEFFICIENTS] {
        std::array::from_fn(|k| self.vector(if k == 0 { 1.5 } else { 0.3 }))
    }

    /// A number between 10^-low and 1, its logarithm uniform.
    fn small(&mut self, low: f32) -> f32 {
        portable::exp(f64::from(-self.unit() * low) * std::f64::consts::LN_10) as f32
    }
}

fn unit(q: Quaternion<f32>) -> Quaternion<f32> {
    rotation::normalize(q.map(f64::from)).map_or([1.0, 0.0, 0.0, 0.0], |q| q.map(|c| c as f32))
}

/// Blends of four influences (two sets of four for `influence_sets` 2): a sixth each of bones near one another, of any bones, of
/// two bones at any angle, of two bones close to half a turn apart, of three that are, and of three or more whose two largest
/// eigenvalues are close. Signs of quaternions are random, weights are not divided by their sum.
pub fn blends(count: usize, influence_sets: usize, seed: u64) -> Batch {
    let mut draw = Draw(SplitMix64::new(seed));
    let mut batch = Batch { influence_sets, ..Batch::new([0.4, 0.3, -3.0]) };
    for case in 0..count {
        let most = 4 * influence_sets;
        let many = 3 + draw.0.below(most - 2);
        let bones = match case % 6 {
            0 => near(&mut draw, 1 + case / 6 % most),
            1 => any(&mut draw, many),
            2 => any(&mut draw, 2),
            3 => half_a_turn_apart(&mut draw),
            4 => three_alike(&mut draw),
            _ => close_eigenvalues(&mut draw, many),
        };
        let (mut joints, mut weights) = (Vec::new(), Vec::new());
        for (q, weight) in bones {
            let sign = if draw.unit() < 0.5 { -1.0 } else { 1.0 };
            joints.push((q.map(|c| sign * c), draw.vector(1.0)));
            weights.push(weight);
        }
        let (gaussian, sh) = (draw.gaussian(), draw.sh());
        batch.push(gaussian, &joints, &weights, sh);
    }
    batch
}

/// The seed of the table of errors.
pub const SEED: u64 = 16;

type Bones = Vec<(Quaternion<f32>, f32)>;

/// Within 60 degrees of one rotation.
fn near(draw: &mut Draw, count: usize) -> Bones {
    let middle = draw.rotation();
    (0..count).map(|_| (unit(rotation::multiply(draw.turn(60.0), middle)), 0.05 + draw.unit())).collect()
}

fn any(draw: &mut Draw, count: usize) -> Bones {
    (0..count).map(|_| (draw.rotation(), 0.05 + draw.unit())).collect()
}

/// Angles from 180 degrees less a millionth on, weights equal but for as little.
fn half_a_turn_apart(draw: &mut Draw) -> Bones {
    let (p, [_, x, y, z]) = (draw.rotation(), draw.rotation());
    let q = rotation::multiply(unit([draw.small(6.0), x, y, z]), p);
    let (weight, apart) = (0.2 + draw.unit(), draw.small(6.0));
    vec![(p, weight), (unit(q), weight * (1.0 - 0.5 * apart))]
}

/// Three bones, each half a turn from the others, of weights close to one another.
fn three_alike(draw: &mut Draw) -> Bones {
    let p = draw.rotation();
    let (weight, apart, further) = (0.2 + draw.unit(), draw.small(6.0), draw.small(6.0));
    let about = |axis: usize| {
        let mut turn = [0.0; 4];
        turn[axis] = 1.0;
        rotation::multiply(turn, p)
    };
    vec![(p, weight), (about(1), weight * (1.0 - 0.5 * apart)), (about(3), weight * (1.0 - 0.5 * further))]
}

/// Two bones as above, and others whose weights are as small as what tells the two apart.
fn close_eigenvalues(draw: &mut Draw, count: usize) -> Bones {
    let mut bones = half_a_turn_apart(draw);
    let apart = draw.small(5.0);
    while bones.len() < count {
        bones.push((draw.rotation(), apart * (0.05 + draw.unit())));
    }
    bones
}

/// Joints of an avatar of the timing.
const JOINTS: usize = 24;

/// An avatar in a pose: a chain of 24 joints, each turned by at most 40 degrees against the one before, Gaussians on it in the order of
/// the joints as on a surface, each with four influences that count.
pub fn avatar(gaussians: usize, pose: u64) -> Batch {
    let mut batch = Batch::new([0.0, 0.0, -4.0]);
    let mut draw = Draw(SplitMix64::new(1000 + pose));
    let mut turned = draw.turn(180.0);
    for k in 0..JOINTS {
        let bent = rotation::multiply(turned, draw.turn(40.0));
        turned = unit(bent);
        batch.joints.push((turned, [0.02 * k as f32, 0.3 * draw.signed(), 0.1 * draw.signed()]));
    }
    // The same avatar in every pose.
    let mut draw = Draw(SplitMix64::new(7));
    for i in 0..gaussians {
        let middle = i * JOINTS / gaussians;
        for offset in [0, 1, 2, 3] {
            batch.indices.push((middle + offset).saturating_sub(1).min(JOINTS - 1) as u32);
        }
        let weights = [0; 4].map(|_| 0.05 + draw.unit());
        let sum: f32 = weights.iter().sum();
        batch.weights.extend(weights.map(|w| w / sum));
        let (gaussian, sh) = (draw.gaussian(), draw.sh());
        batch.gaussians.push(gaussian);
        batch.sh.push(sh);
    }
    batch
}
