//! iHuman's parametrisation: every Gaussian a disc in its face.

use super::lanes::{LANES, put, take};
use super::layout::{CHUNK, Chunk};
use super::surface::Surface;
use rayon::prelude::*;
use skinsplat_core::math::{Matrix3, Quaternion, dot4, matrix3, rotation};

/// Thickness along the normal: a standard deviation, metres.
const THICKNESS: f32 = 1e-3;

/// Below this length the direction of the in-plane angle is no direction.
const SHORTEST: f32 = 1e-6;

/// The same Gaussians with `R_c = [n | c r1 + s r2 | c r2 − s r1]` on the rest face and `S = (1 mm, e^s0, e^s1)`.
///
/// The axis of R_c nearest to the normal becomes n, the in-plane angle (c, s) is the one nearest to the other two, so an
/// avatar that iHuman fitted stays as it is. Gaussians on a face without area stay as they are, too.
pub(super) fn discs(chunks: &[Chunk], surface: &Surface) -> Vec<Chunk> {
    let mut discs = chunks.to_vec();
    refresh(&mut discs, chunks, surface);
    discs
}

/// Makes the discs of Gaussians that have changed.
pub(super) fn refresh(discs: &mut [Chunk], chunks: &[Chunk], surface: &Surface) {
    discs.par_iter_mut().zip(chunks).enumerate().for_each(|(c, (discs, chunk))| {
        for (disc, block) in discs.blocks.iter_mut().zip(&chunk.blocks) {
            disc.means = block.means;
            for lane in 0..LANES {
                let gaussian = c * CHUNK + usize::from(block.index[lane]);
                let own = take(&block.rotations, lane);
                let scales = [0, 1, 2].map(|axis: usize| block.scales[axis][lane]);
                let (rotation, scales) = match Disc::nearest(own, surface, gaussian) {
                    Some(disc) => (disc.rotation(), disc.scales(scales)),
                    None => (own, scales),
                };
                put(&mut disc.rotations, lane, rotation);
                for axis in 0..3 {
                    disc.scales[axis][lane] = scales[axis];
                }
            }
        }
    });
}

/// The disc nearest to a Gaussian.
pub(super) struct Disc {
    /// The columns of R_c.
    axes: Matrix3<f32>,
    /// Which of them become the second and the third.
    in_plane: [usize; 2],
    /// 1, or −1 where the thin axis points against n: the third column then counts negatively.
    upright: f32,
    /// n, r1, r2 of the rest face.
    frame: Matrix3<f32>,
    /// The in-plane angle as a direction (c, s), not of unit length; zero where R_c has none.
    direction: [f32; 2],
}

impl Disc {
    /// `None` on a face without area.
    pub(super) fn nearest(own: Quaternion<f32>, surface: &Surface, gaussian: usize) -> Option<Self> {
        let frame = surface.faces.edge01[surface.embeddings[gaussian].face as usize]?;
        // SplattingAvatar's columns are [d × n, −n, d]; iHuman's are [n, −d, d × n].
        let [across, minus_n, d] = matrix3::transpose(frame);
        let negated = |v: [f32; 3]| v.map(|c| -c);
        let (n, r1, r2) = (negated(minus_n), negated(d), across);
        let axes = matrix3::transpose(rotation::quaternion_to_matrix_raw(own));
        let height = axes.map(|axis| matrix3::dot(axis, n).abs());
        let thin = (0..3).fold(0, |best, k| if height[k] > height[best] { k } else { best });
        let in_plane = [(thin + 1) % 3, (thin + 2) % 3];
        let upright = if matrix3::dot(axes[thin], n) >= 0.0 { 1.0 } else { -1.0 };
        let (u, v) = (axes[in_plane[0]], axes[in_plane[1]].map(|c| upright * c));
        let cosine = matrix3::dot(u, r1) + matrix3::dot(v, r2);
        let sine = matrix3::dot(u, r2) - matrix3::dot(v, r1);
        let settled = (cosine * cosine + sine * sine).sqrt() > SHORTEST;
        let direction = if settled { [cosine, sine] } else { [0.0; 2] };
        Some(Self { axes, in_plane, upright, frame: [n, r1, r2], direction })
    }

    /// Its R_c.
    fn rotation(&self) -> Quaternion<f32> {
        let [n, r1, r2] = self.frame;
        let [cosine, sine] = self.direction;
        let length = (cosine * cosine + sine * sine).sqrt();
        let (c, s) = if length > 0.0 { (cosine / length, sine / length) } else { (1.0, 0.0) };
        rotation::matrix_to_quaternion(
            [0, 1, 2].map(|k: usize| [n[k], c * r1[k] + s * r2[k], c * r2[k] - s * r1[k]]),
        )
    }

    /// Its standard deviations, of those of the Gaussian.
    fn scales(&self, own: [f32; 3]) -> [f32; 3] {
        [THICKNESS, own[self.in_plane[0]], own[self.in_plane[1]]]
    }

    /// The derivatives with respect to R_c (without a part along it) and the log scales of the Gaussian, from those with
    /// respect to the disc's. Only the in-plane angle follows R_c; the thickness follows nothing. `own` and `snapped` are
    /// the quaternions of the Gaussian and of the disc.
    pub(super) fn adjoint(
        &self,
        own: Quaternion<f32>,
        snapped: Quaternion<f32>,
        of_rotation: Quaternion<f32>,
        of_log_scales: [f32; 3],
    ) -> (Quaternion<f32>, [f32; 3]) {
        let [first, second] = self.in_plane;
        let mut log_scales = [0.0; 3];
        (log_scales[first], log_scales[second]) = (of_log_scales[1], of_log_scales[2]);
        let [cosine, sine] = self.direction;
        let squared = cosine * cosine + sine * sine;
        if squared == 0.0 {
            return ([0.0; 4], log_scales);
        }
        // A larger angle turns the disc about its normal.
        let [n, r1, r2] = self.frame;
        let turned = rotation::multiply([0.0, n[0], n[1], n[2]], snapped);
        let of_angle = 0.5 * dot4(turned, of_rotation);
        let (of_cosine, of_sine) = (-of_angle * sine / squared, of_angle * cosine / squared);
        let of_u = [0, 1, 2].map(|k: usize| of_cosine * r1[k] + of_sine * r2[k]);
        let of_v = [0, 1, 2].map(|k: usize| self.upright * (of_cosine * r2[k] - of_sine * r1[k]));
        let about_u = matrix3::cross(self.axes[first], of_u);
        let torque = matrix3::add_scaled(about_u, 1.0, matrix3::cross(self.axes[second], of_v));
        (rotation::adjoint::from_torque(own, torque), log_scales)
    }
}
