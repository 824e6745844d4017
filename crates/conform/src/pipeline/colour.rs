//! SH turned with the Gaussian, and the view direction turned back: two ways to the same colour.

use super::super::convention::{degree_and_order, put_sh, turn_coefficients};
use super::super::sample::{Field, Sample, range};
use super::super::wiring::{Basis, Product, Turn, Unit, Wiring};
use super::joints::rotate;
use super::{Blended, Part, Pipeline, of_length};
use skinsplat_core::math::{matrix3, rotation, sh};

/// Writes directions and SH.
pub(super) fn write(
    pipeline: &Pipeline<'_>,
    wiring: &Wiring,
    i: usize,
    blended: &Blended,
    part: Part,
    sample: &mut Sample,
) {
    let relative = match wiring.product {
        Product::NotTurned => rotation::identity(),
        _ => rotation::normalize(blended.relative).unwrap_or(rotation::identity()),
    };
    let away = matrix3::add_scaled(blended.mean, -1.0, pipeline.rig.eye().to_array());
    let length = matrix3::dot(away, away).sqrt();
    let length = if wiring.direction_is_reversed { -length } else { length };
    let direction = away.map(|c| c / length);
    let turned = match wiring.direction {
        Turn::Right if matches!(wiring.unit, Unit::RawMatrix | Unit::RawProduct) => {
            let turn = of_length(wiring.unit, blended.relative);
            matrix3::apply(matrix3::transpose(turn), direction)
        }
        Turn::Right => rotate(rotation::conjugate(relative), direction),
        Turn::Not => direction,
        Turn::Backwards => rotate(relative, direction),
    };
    sample[range(Field::Directions)].copy_from_slice(&turned);
    if part == Part::All {
        put_sh(sample, &coefficients(pipeline, wiring, i, relative));
    }
}

fn coefficients(pipeline: &Pipeline<'_>, wiring: &Wiring, i: usize, relative: [f64; 4]) -> [[f64; 3]; 16] {
    let canonical: [[f64; 3]; 16] =
        std::array::from_fn(|k| pipeline.rig.gaussians.sh[16 * i + k].map(f64::from));
    let turned_by = |q: [f64; 4]| match wiring.basis {
        Basis::Right => {
            let mut turned = canonical;
            sh::Rotation::from_quaternion(q, 3).apply(&mut turned);
            turned
        }
        _ => turned_in_basis(pipeline, wiring, &canonical, q),
    };
    let mut all = turned_by(relative);
    if wiring.sh == [Turn::Right; 3] {
        return all;
    }
    let back = turned_by(rotation::conjugate(relative));
    for (k, rgb) in all.iter_mut().enumerate().skip(1) {
        match wiring.sh[degree_and_order(k).0 - 1] {
            Turn::Right => {}
            Turn::Not => *rgb = canonical[k],
            Turn::Backwards => *rgb = back[k],
        }
    }
    all
}

/// Turned where basis functions have other signs, in the axes that they are of.
fn turned_in_basis(
    pipeline: &Pipeline<'_>,
    wiring: &Wiring,
    canonical: &[[f64; 3]; 16],
    q: [f64; 4],
) -> [[f64; 3]; 16] {
    let axes = pipeline.space(wiring.basis_space);
    let flip = |coefficients: &mut [[f64; 3]; 16]| {
        for (k, rgb) in coefficients.iter_mut().enumerate() {
            if is_flipped(wiring.basis, k) {
                rgb.iter_mut().for_each(|c| *c = -*c);
            }
        }
    };
    let same = axes.map == matrix3::identity::<f64>();
    let mut turned = *canonical;
    if !same {
        turn_coefficients(&axes.map, &mut turned);
    }
    flip(&mut turned);
    sh::Rotation::from_quaternion(axes.rotation(q), 3).apply(&mut turned);
    flip(&mut turned);
    if !same {
        turn_coefficients(&matrix3::transpose(axes.map), &mut turned);
    }
    turned
}

/// True if the basis function of a coefficient has the other sign.
pub(crate) fn is_flipped(basis: Basis, k: usize) -> bool {
    let (l, m) = degree_and_order(k);
    match basis {
        Basis::Right => false,
        Basis::OddOrders => m % 2 != 0,
        Basis::One(other) => k == other,
        // Under x to -x the functions cos(m φ) of odd m and sin(m φ) of even m change their sign.
        Basis::Axis(0) => {
            if m >= 0 {
                m % 2 != 0
            } else {
                m % 2 == 0
            }
        }
        Basis::Axis(1) => m < 0,
        Basis::Axis(_) => (l as i32 + m) % 2 != 0,
    }
}
