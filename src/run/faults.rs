//! Faults that are seeded on purpose, to see that a comparison catches them: compiled in by the feature `faults` alone, which the
//! tests of this package ask for, without effect in a release, and switched on by the environment variable [`VARIABLE`].
//!
//! They are applied where plain data passes, to the avatar before it is bound, to [`Posed`], to the camera, to what is behind, and to
//! what is scored: no kernel knows of them.

use glam::{DVec3, Mat3, Vec3};
use skinsplat_core::scene::{Avatar, Binding, Camera, Mask, OwnedPosed, Posed, SkinWeights};
use skinsplat_metrics::{Protocol, SsimVariant};
use std::borrow::Cow;

/// The environment variable that names the fault.
pub const VARIABLE: &str = "SKINSPLAT_FAULT";

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Rotations of Gaussians transposed.
    TransposedRotation,
    /// The second band of the SH left out.
    DroppedBand,
    /// w and x of the stored quaternions swapped.
    SwappedQuaternion,
    /// Quaternions a twentieth too long, made matrices as if they were not.
    UnnormalisedQuaternion,
    /// The principal point half a pixel off.
    HalfPixel,
    /// Gaussians drawn in the order in which they are stored, not by depth.
    Unsorted,
    /// SSIM over uniform windows of 7 pixels.
    SsimWindow,
    /// The render drawn over the opposite of the protocol's colour.
    Background,
    /// The truth's mask taken as full.
    MaskIgnored,
    /// The sign of one SH coefficient.
    ShSign,
    /// A near plane that reaches into the subject.
    NearPlane,
    /// The weights of one joint given to its neighbour.
    JointWeights,
}

impl Fault {
    /// All of them, with their names.
    pub const ALL: [(&str, Self); 12] = [
        ("transposed-rotation", Self::TransposedRotation),
        ("dropped-band", Self::DroppedBand),
        ("swapped-quaternion", Self::SwappedQuaternion),
        ("unnormalised-quaternion", Self::UnnormalisedQuaternion),
        ("half-pixel", Self::HalfPixel),
        ("unsorted", Self::Unsorted),
        ("ssim-window", Self::SsimWindow),
        ("background", Self::Background),
        ("mask-ignored", Self::MaskIgnored),
        ("sh-sign", Self::ShSign),
        ("near-plane", Self::NearPlane),
        ("joint-weights", Self::JointWeights),
    ];

    /// The fault that the environment names; none without the variable or under another name, and none in a release.
    fn seeded() -> Option<Self> {
        if !cfg!(debug_assertions) {
            return None;
        }
        let name = std::env::var(VARIABLE).ok()?;
        Self::ALL.into_iter().find(|(of, _)| *of == name).map(|(_, fault)| fault)
    }
}

/// The avatar that is bound.
pub(super) fn of_avatar(avatar: &Avatar) -> Cow<'_, Avatar> {
    let mut avatar = Cow::Borrowed(avatar);
    match Fault::seeded() {
        Some(Fault::SwappedQuaternion) => {
            avatar.to_mut().gaussians.rotations.iter_mut().for_each(|q| q.swap(0, 1));
        }
        Some(Fault::JointWeights) => {
            if let Binding::Vertex(weights) = &mut avatar.to_mut().binding {
                *weights = without_joint_1(weights);
            }
        }
        _ => {}
    }
    avatar
}

/// The weights with those of joint 1 given to joint 0.
fn without_joint_1(weights: &SkinWeights) -> SkinWeights {
    let moved = |joint: u16| if joint == 1 { 0 } else { usize::from(joint) };
    let row = |i: usize| {
        let (joints, weights) = weights.row(i);
        joints.iter().zip(weights).map(|(&joint, &weight)| (moved(joint), weight)).collect::<Vec<_>>()
    };
    let joints =
        (0..weights.len()).flat_map(|i| weights.row(i).0).max().map_or(1, |&most| usize::from(most) + 1);
    SkinWeights::from_rows((0..weights.len()).map(row), joints).unwrap_or_else(|_| weights.clone())
}

/// What is drawn, and the camera that sees it; none where nothing is changed.
pub(super) fn of_drawing(posed: Posed<'_>, camera: &Camera) -> Option<(OwnedPosed, Camera)> {
    let fault = Fault::seeded()?;
    let (mut posed, mut camera) = (posed.into_owned(), camera.clone());
    match fault {
        Fault::TransposedRotation => rotated(&mut posed, |r| r.transpose()),
        // Every entry of R(q) but the identity's is quadratic in q.
        Fault::UnnormalisedQuaternion => {
            rotated(&mut posed, |r| Mat3::IDENTITY + (r - Mat3::IDENTITY) * (1.05 * 1.05));
        }
        Fault::DroppedBand => coefficients(&mut posed, 1..4, 0.0),
        Fault::ShSign => coefficients(&mut posed, 2..3, -1.0),
        Fault::HalfPixel => camera.cx += 0.5,
        Fault::Unsorted => unsorted(&mut posed, &camera),
        Fault::NearPlane => near_plane(&mut posed, &camera),
        _ => return None,
    }
    Some((posed, camera))
}

/// Replaces the rotation in each factor M = R diag(s).
fn rotated(posed: &mut OwnedPosed, change: impl Fn(Mat3) -> Mat3) {
    for factor in &mut posed.factors {
        let columns = [factor.x_axis, factor.y_axis, factor.z_axis];
        let scales = columns.map(Vec3::length);
        let [x, y, z] = columns.map(Vec3::normalize_or_zero);
        *factor = change(Mat3::from_cols(x, y, z)) * Mat3::from_diagonal(Vec3::from_array(scales));
    }
}

/// Scales some SH coefficients of every Gaussian.
fn coefficients(posed: &mut OwnedPosed, which: std::ops::Range<usize>, by: f32) {
    let count = (posed.sh_degree + 1).pow(2);
    for own in posed.sh.chunks_exact_mut(count) {
        for coefficient in &mut own[which.start.min(count)..which.end.min(count)] {
            coefficient.iter_mut().for_each(|value| *value *= by);
        }
    }
}

/// Depths of the Gaussians before the camera.
fn depths(posed: &OwnedPosed, camera: &Camera) -> Vec<f64> {
    posed.means.iter().map(|mean| camera.camera_from_world.transform_point3(mean.as_dvec3()).z).collect()
}

fn range(depths: &[f64]) -> [f64; 2] {
    let nearest = depths.iter().copied().fold(f64::INFINITY, f64::min);
    [nearest, depths.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
}

/// Moves every Gaussian along its ray to a depth that is in the order of the indices, and scales it as much, so that it looks the same:
/// what is drawn is what a rasterizer draws that does not sort.
fn unsorted(posed: &mut OwnedPosed, camera: &Camera) {
    let depths = depths(posed, camera);
    let ([near, far], eye, n) = (range(&depths), camera.position(), depths.len() as f64);
    for (i, &depth) in depths.iter().enumerate() {
        if depth > 0.0 && near > 0.0 {
            let by = (near + (far - near) * i as f64 / n) / depth;
            let ray: DVec3 = posed.means[i].as_dvec3() - eye;
            posed.means[i] = (eye + ray * by).as_vec3();
            posed.factors[i] *= by as f32;
        }
    }
}

/// Makes transparent what is in the nearest quarter of the depths.
fn near_plane(posed: &mut OwnedPosed, camera: &Camera) {
    let depths = depths(posed, camera);
    let [near, far] = range(&depths);
    for (opacity, depth) in posed.opacities.iter_mut().zip(depths) {
        if depth < near + 0.25 * (far - near) {
            *opacity = 0.0;
        }
    }
}

/// The colour over which a render is drawn.
pub(super) fn of_background(colour: [f32; 3]) -> [f32; 3] {
    match Fault::seeded() {
        Some(Fault::Background) => colour.map(|value| 1.0 - value),
        _ => colour,
    }
}

/// What is scored: the protocol, and the truth's mask.
pub(super) fn of_scoring<'a>(protocol: &'a Protocol, alpha: &'a Mask) -> (Cow<'a, Protocol>, Cow<'a, Mask>) {
    let (mut protocol, mut alpha) = (Cow::Borrowed(protocol), Cow::Borrowed(alpha));
    match Fault::seeded() {
        Some(Fault::SsimWindow) => protocol.to_mut().ssim = SsimVariant::Uniform7,
        Some(Fault::MaskIgnored) => alpha.to_mut().values_mut().fill(1.0),
        _ => {}
    }
    (protocol, alpha)
}
