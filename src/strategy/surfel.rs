//! iHuman's parametrisation: every Gaussian a disc in its face.

use super::bound::Surface;
use super::layout::{CHUNK, Chunk, LANES};
use super::rotate::{put, take};
use crate::math::{Matrix3, matrix3, rotation};

/// Thickness along the normal: a standard deviation, metres.
const THICKNESS: f32 = 1e-3;

/// The same Gaussians with `R_c = [n | c r1 + s r2 | c r2 − s r1]` on the rest face and `S = (1 mm, e^s0, e^s1)`.
///
/// The axis of R_c nearest to the normal becomes n, the in-plane angle (c, s) is the one nearest to the other two, so an
/// avatar that iHuman fitted stays as it is. Gaussians on a face without area stay as they are, too.
pub(super) fn discs(chunks: &[Chunk], surface: &Surface) -> Vec<Chunk> {
    let mut chunks = chunks.to_vec();
    for (c, chunk) in chunks.iter_mut().enumerate() {
        for block in &mut chunk.blocks {
            for lane in 0..LANES {
                let seat = &surface.seats[c * CHUNK + usize::from(block.index[lane])];
                let Some(frame) = surface.faces.edge01[seat.face as usize] else { continue };
                let own = rotation::quaternion_to_matrix_raw(take(&block.rotations, lane));
                let (turned, [first, second]) = nearest_disc(own, frame);
                put(&mut block.rotations, lane, rotation::matrix_to_quaternion(turned));
                let scales = [THICKNESS, block.scales[first][lane], block.scales[second][lane]];
                for axis in 0..3 {
                    block.scales[axis][lane] = scales[axis];
                }
            }
        }
    }
    chunks
}

/// iHuman's frame nearest to R_c, and the columns of R_c that become its second and third. `frame` is SplattingAvatar's
/// of the rest face.
fn nearest_disc(own: Matrix3<f32>, frame: Matrix3<f32>) -> (Matrix3<f32>, [usize; 2]) {
    // The columns of the frame are [d × n, −n, d]; iHuman's are [n, −d, d × n].
    let [across, minus_n, d] = matrix3::transpose(frame);
    let negated = |v: [f32; 3]| v.map(|c| -c);
    let (n, r1, r2) = (negated(minus_n), negated(d), across);
    let axes = matrix3::transpose(own);
    let height = axes.map(|axis| matrix3::dot(axis, n).abs());
    let thin = (0..3).fold(0, |best, k| if height[k] > height[best] { k } else { best });
    let [first, second] = [(thin + 1) % 3, (thin + 2) % 3];
    let upright = matrix3::dot(axes[thin], n) >= 0.0;
    let (u, v) = (axes[first], if upright { axes[second] } else { negated(axes[second]) });
    let cosine = matrix3::dot(u, r1) + matrix3::dot(v, r2);
    let sine = matrix3::dot(u, r2) - matrix3::dot(v, r1);
    let length = (cosine * cosine + sine * sine).sqrt();
    let (c, s) = if length > 1e-6 { (cosine / length, sine / length) } else { (1.0, 0.0) };
    let columns = [0, 1, 2].map(|k: usize| [n[k], c * r1[k] + s * r2[k], c * r2[k] - s * r1[k]]);
    (columns, [first, second])
}
