//! Differences of posing, per Gaussian and parameter, to hold its adjoint against.

use super::rig;
use glam::Mat3;
use skinsplat_core::scene::{
    Avatar, AvatarGradient, Binding, FaceBinding, OwnedPosed, PosedBody, PosedGradient,
};
use skinsplat_posing::{
    BoundAvatar, CovarianceChoice, LbsProjection, PoseOptions, Poser, RotationChoice, Strategy, pose,
};

/// A parameter that every Gaussian has.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Parameter {
    Mean(usize),
    Rotation(usize),
    LogScale(usize),
    Opacity,
    Barycentric(usize),
    Offset,
}

impl Parameter {
    fn all(face_bound: bool) -> Vec<Self> {
        let mut all = Vec::new();
        if face_bound {
            all.extend((0..3).map(Self::Barycentric));
            all.push(Self::Offset);
        } else {
            all.extend((0..3).map(Self::Mean));
        }
        all.extend((0..4).map(Self::Rotation));
        all.extend((0..3).map(Self::LogScale));
        all.push(Self::Opacity);
        all
    }

    /// Of the entries of one name, which are measured together.
    fn value(self, gradient: &AvatarGradient, i: usize) -> f64 {
        f64::from(match self {
            Self::Mean(k) => gradient.means[i][k],
            Self::Rotation(k) => gradient.rotations[i][k],
            Self::LogScale(k) => gradient.log_scales[i][k],
            Self::Opacity => gradient.opacity_logits[i],
            Self::Barycentric(k) => gradient.barycentric[i][k],
            Self::Offset => gradient.offsets[i],
        })
    }

    /// The avatar with the parameter of every Gaussian moved by `factor` times its step, and the steps as they are after
    /// rounding.
    pub(crate) fn moved(self, avatar: &Avatar, factor: f32) -> (Avatar, Vec<f64>) {
        let mut moved = avatar.clone();
        let Avatar { gaussians, binding } = &mut moved;
        let mut no_faces = FaceBinding::default();
        let faces = if let Binding::Face(faces) = binding { faces } else { &mut no_faces };
        let steps = (0..avatar.gaussians.len()).map(|i| {
            let length = avatar.gaussians.rotations[i].iter().map(|c| c * c).sum::<f32>().sqrt();
            let (entry, step) = match self {
                Self::Mean(k) => (&mut gaussians.means[i][k], 0.5),
                Self::Rotation(k) => (&mut gaussians.rotations[i][k], 0.02 * length),
                Self::LogScale(k) => (&mut gaussians.log_scales[i][k], 0.05),
                Self::Opacity => (&mut gaussians.opacity_logits[i], 0.05),
                Self::Barycentric(k) => (&mut faces.barycentric[i][k], 0.008),
                Self::Offset => (&mut faces.offsets[i], 0.1),
            };
            let before = *entry;
            *entry += factor * step;
            f64::from(*entry) - f64::from(before)
        });
        let steps = steps.collect();
        (moved, steps)
    }
}

/// A gradient at every entry of a pose, of such sizes that every kind of output counts.
pub(crate) fn upstream(posed: &OwnedPosed, seed: u64) -> PosedGradient {
    let mut noise = rig::Noise(seed);
    let mut gradient = PosedGradient::default();
    gradient.reset(&posed.as_posed());
    gradient.means.iter_mut().for_each(|g| *g = noise.vector().as_vec3());
    for g in &mut gradient.factors {
        let [a, b, c] = [0; 3].map(|_| noise.vector().as_vec3() * 100.0);
        *g = Mat3::from_cols(a, b, c);
    }
    gradient.opacities.iter_mut().for_each(|g| *g = noise.next() as f32);
    gradient.sh.iter_mut().for_each(|g| *g = noise.vector().as_vec3().to_array());
    gradient
}

/// Per Gaussian, what the upstream gradient is a derivative of.
fn losses(posed: &OwnedPosed, upstream: &PosedGradient, means_only: bool) -> Vec<f64> {
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
    let count = (posed.sh_degree + 1).pow(2);
    let loss = |i: usize| {
        let means = dot(posed.means[i].as_ref(), upstream.means[i].as_ref());
        if means_only {
            return means;
        }
        let sh = i * count..(i + 1) * count;
        means
            + dot(&posed.factors[i].to_cols_array(), &upstream.factors[i].to_cols_array())
            + f64::from(posed.opacities[i]) * f64::from(upstream.opacities[i])
            + dot(posed.sh[sh.clone()].as_flattened(), upstream.sh[sh].as_flattened())
    };
    (0..posed.len()).map(loss).collect()
}

/// An avatar bound to a posed body.
pub(crate) struct Case<'a> {
    pub(crate) avatar: Avatar,
    pub(crate) bound: BoundAvatar,
    pub(crate) body: &'a PosedBody<'a>,
}

impl<'a> Case<'a> {
    pub(crate) fn new(avatar: Avatar, body: &'a PosedBody<'a>) -> Self {
        let bound = BoundAvatar::new(&avatar, body.rest).unwrap();
        Self { avatar, bound, body }
    }

    pub(crate) fn gradient(&self, strategy: &Strategy, upstream: &PosedGradient) -> AvatarGradient {
        let mut gradient = AvatarGradient::default();
        gradient.reset(&self.avatar.gaussians, matches!(self.avatar.binding, Binding::Face(_)));
        let Self { bound, body, avatar } = self;
        let options = PoseOptions::default();
        Poser::new()
            .backward(bound, body, strategy, &options, &avatar.gaussians, upstream, &mut gradient)
            .unwrap();
        gradient
    }

    /// Losses of every Gaussian with one parameter moved.
    fn moved(
        &self,
        strategy: &Strategy,
        upstream: &PosedGradient,
        parameter: Parameter,
        factor: f32,
    ) -> (Vec<f64>, Vec<f64>) {
        let (avatar, steps) = parameter.moved(&self.avatar, factor);
        let mut bound = self.bound.clone();
        bound.update(&avatar).unwrap();
        let posed = pose(&bound, self.body, strategy).unwrap();
        // Barycentric coordinates are followed into positions only, by contract.
        let means_only = matches!(parameter, Parameter::Barycentric(_));
        (losses(&posed, upstream, means_only), steps)
    }

    /// Central differences of fourth order.
    fn differences(
        &self,
        strategy: &Strategy,
        upstream: &PosedGradient,
        parameter: Parameter,
    ) -> [Vec<f64>; 2] {
        // Steps of half a metre are for what is linear: two centimetres where R or the normal depends on the mean.
        let along_mean = matches!(parameter, Parameter::Mean(_) | Parameter::Offset);
        let unit = if along_mean && rig::pushes(strategy) { 0.04 } else { 1.0 };
        let slope = |factor: f32| {
            let factor = factor * unit;
            let (up, forth) = self.moved(strategy, upstream, parameter, factor);
            let (down, back) = self.moved(strategy, upstream, parameter, -factor);
            let of = |i: usize| (up[i] - down[i]) / (forth[i] - back[i]);
            (0..up.len()).map(of).collect::<Vec<f64>>()
        };
        let (half, full) = (slope(0.5), slope(1.0));
        let fourth = half.iter().zip(&full).map(|(half, full)| (4.0 * half - full) / 3.0).collect();
        [fourth, full]
    }

    /// The largest error of a parameter's derivatives, over the size of the derivatives. Gaussians within a step of a
    /// place where the strategy chooses have no difference; they are counted.
    pub(crate) fn error(
        &self,
        strategy: &Strategy,
        upstream: &PosedGradient,
        kind: &[Parameter],
    ) -> (f64, usize) {
        let gradient = self.gradient(strategy, upstream);
        let differences: Vec<_> =
            kind.iter().map(|&parameter| self.differences(strategy, upstream, parameter)).collect();
        let n = self.bound.len();
        let size_of = |i: usize| kind.iter().map(|p| p.value(&gradient, i).powi(2)).sum::<f64>();
        let typical = ((0..n).map(size_of).sum::<f64>() / n as f64).sqrt();
        let (mut worst, mut switching) = (0.0f64, 0);
        for i in 0..n {
            let size = size_of(i).sqrt().max(typical);
            let jumps = |[fourth, full]: &[Vec<f64>; 2]| (fourth[i] - full[i]).abs() > 0.02 * size;
            if chooses(strategy) && differences.iter().any(jumps) {
                switching += 1;
                continue;
            }
            for (parameter, [expected, _]) in kind.iter().zip(&differences) {
                worst = worst.max((parameter.value(&gradient, i) - expected[i]).abs() / size);
            }
        }
        (worst, switching)
    }
}

/// True if what becomes of a Gaussian jumps somewhere: at the branches of a conversion, at another thin axis, where two
/// rotations are as near to the derivative of LBS, where the posed surface folds.
pub(crate) fn chooses(strategy: &Strategy) -> bool {
    let converts = matches!(
        strategy.rotation,
        RotationChoice::Lbs(LbsProjection::MatrixToQuaternion | LbsProjection::MatrixToQuaternionRaw)
    );
    let nearest = matches!(strategy.rotation, RotationChoice::PushForward(_));
    let folds = strategy.covariance == CovarianceChoice::PushForwardNormal;
    converts || nearest || folds || strategy.covariance == CovarianceChoice::Surfel
}

pub(crate) fn kinds(face_bound: bool) -> Vec<Vec<Parameter>> {
    let mut kinds: Vec<Vec<Parameter>> = Vec::new();
    for parameter in Parameter::all(face_bound) {
        let same = |kind: &&mut Vec<Parameter>| {
            std::mem::discriminant(&kind[0]) == std::mem::discriminant(&parameter)
        };
        match kinds.iter_mut().find(same) {
            Some(kind) => kind.push(parameter),
            None => kinds.push(vec![parameter]),
        }
    }
    kinds
}
