//! The last stage: axes, units, activation and order, as the file has them.

use super::super::convention::{put_sh, remap, sh_of, turn_covariance, turn_sh};
use super::super::sample::{Field, Sample, Storage, range};
use super::super::wiring::{Activation, Axes, Scale, ShLayout, Wiring};
use super::Pipeline;
use skinsplat_core::math::{matrix3, portable, rotation};

/// From metres, (w, x, y, z) and logits to the numbers of the file. The opacity comes as a logit.
pub(super) fn finish(pipeline: &Pipeline<'_>, wiring: &Wiring, sample: &mut Sample) {
    world_axes(wiring, sample);
    activate(pipeline.storage, wiring, sample);
    if let Some(factor) = wiring.units {
        sample[range(Field::Means)].iter_mut().for_each(|v| *v *= factor);
        sample[range(Field::Covariances)].iter_mut().for_each(|v| *v *= factor * factor);
        let logarithms = pipeline.storage == Storage::Logarithms;
        let shift = portable::ln(factor);
        let scaled = |v: &mut f64| if logarithms { *v += shift } else { *v *= factor };
        sample[range(Field::Scales)].iter_mut().for_each(scaled);
    }
    pipeline.convention.encode(sample, pipeline.storage == Storage::Logarithms);
    let at = range(Field::Quaternions).start;
    let q = std::array::from_fn(|k| sample[at + k]);
    // A PLY names its components: rot_0 is w in any convention.
    let ordered = match pipeline.storage {
        Storage::Activated => pipeline.convention.quaternions.ordered(q),
        Storage::Logarithms => q,
    };
    sample[range(Field::Quaternions)].copy_from_slice(&wiring.order.misread(ordered));
    rearrange(wiring.layout, sample);
}

fn world_axes(wiring: &Wiring, sample: &mut Sample) {
    if let Some(axis) = wiring.mirror {
        let mut map = matrix3::identity();
        map[axis][axis] = -1.0;
        remap(&map, sample);
    }
    match wiring.axes {
        Axes::Right => {}
        Axes::Both(turned) => remap(&turned.matrix(), sample),
        Axes::World(turned) => {
            let map = turned.matrix();
            let at = range(Field::Means).start;
            let mean = matrix3::apply(map, [sample[at], sample[at + 1], sample[at + 2]]);
            sample[range(Field::Means)].copy_from_slice(&mean);
            let at = range(Field::Quaternions).start;
            let q = rotation::multiply(turned.quaternion(), std::array::from_fn(|k| sample[at + k]));
            sample[range(Field::Quaternions)].copy_from_slice(&q);
            turn_covariance(&map, sample);
            turn_sh(&map, sample);
        }
    }
}

/// Scales and opacities as the file stores them.
fn activate(storage: Storage, wiring: &Wiring, sample: &mut Sample) {
    let sigmoid = |x: f64| 1.0 / (1.0 + portable::exp(-x));
    let at = range(Field::Opacities).start;
    let logit = sample[at];
    sample[at] = match (storage, wiring.opacity) {
        (Storage::Activated, Activation::Right) => sigmoid(logit),
        (Storage::Activated, Activation::Twice) => sigmoid(sigmoid(logit)),
        (Storage::Activated, Activation::Never) => logit,
        (Storage::Logarithms, Activation::Right) => logit,
        (Storage::Logarithms, Activation::Twice) => sigmoid(logit),
        (Storage::Logarithms, Activation::Never) => portable::ln(logit / (1.0 - logit)),
    };
    // `Scale::Never` already is a logarithm, whose logarithm no file holds: NaN, which matches nothing.
    let logarithm = |v: f64| if matches!(wiring.scale, Scale::Never(_)) { f64::NAN } else { portable::ln(v) };
    if storage == Storage::Logarithms {
        sample[range(Field::Scales)].iter_mut().for_each(|v| *v = logarithm(*v));
    }
}

/// Other orders of the SH of bands 1 to 3.
fn rearrange(layout: ShLayout, sample: &mut Sample) {
    if layout == ShLayout::Right {
        return;
    }
    let old = sh_of(sample);
    let mut new = old;
    if layout == ShLayout::Bgr {
        return put_sh(sample, &old.map(|[r, g, b]| [b, g, r]));
    }
    for k in 1..16 {
        for channel in 0..3 {
            let flat = 3 * (k - 1) + channel;
            new[k][channel] = match layout {
                ShLayout::Right | ShLayout::Bgr => old[k][channel],
                ShLayout::Planar => old[1 + flat % 15][flat / 15],
                ShLayout::Interleaved => {
                    let planar = channel * 15 + k - 1;
                    old[1 + planar / 3][planar % 3]
                }
                ShLayout::OrdersReversed => {
                    let l = k.isqrt();
                    old[2 * (l * l + l) - k][channel]
                }
            };
        }
    }
    put_sh(sample, &new);
}
