//! The weighted average of rotations (Eq. 7) by several solvers, and spherical harmonics turned by it (Eq. 9).
//!
//! `cargo run -p skinsplat-core --example average_rotations`
#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "an example")]

use skinsplat_core::math::average::{Solver, average};
use skinsplat_core::math::rotation::{angle_between, conjugate, quaternion_to_matrix};
use skinsplat_core::math::{matrix3, sh};

fn main() {
    // An upper arm at rest and a forearm bent by 120 degrees about z; a Gaussian at the elbow hangs on both.
    let half = 60f64.to_radians();
    let bones = [[1.0, 0.0, 0.0, 0.0], [half.cos(), 0.0, 0.0, half.sin()]];
    let weights = [0.7, 0.3];
    let exact = average(&bones, &weights, Solver::ClosedForm).expect("weights above zero");
    println!("average: {:?}, determined with a gap of {:.3}", exact.quat, exact.gap);
    for id in ["eigen", "nlerp", "power-0", "power-4"] {
        let solver: Solver = id.parse().expect("the id of a solver");
        let Some(other) = average(&bones, &weights, solver) else { continue };
        println!("{id:8} is off by {:.4} degrees", angle_between(other.quat, exact.quat).to_degrees());
    }

    // A colour that leans towards +x: after the rotation it leans where the rotation takes +x.
    let mut coefficients = [[0.0f64; 3]; 4];
    coefficients[3] = [-0.5; 3];
    let seen = |sh: &[[f64; 3]], direction| sh::evaluate(1, sh, direction)[0];
    println!("seen along +x, at rest: {:.3}", seen(&coefficients, [1.0, 0.0, 0.0]));
    let rotation = quaternion_to_matrix(exact.quat);
    sh::Rotation::<f64>::new(rotation, 1).apply(&mut coefficients);
    println!(
        "seen along R x, rotated: {:.3}",
        seen(&coefficients, matrix3::apply(rotation, [1.0, 0.0, 0.0]))
    );
    let back = quaternion_to_matrix(conjugate(exact.quat));
    println!("seen along R^-1 x, rotated: {:.3}", seen(&coefficients, matrix3::apply(back, [1.0, 0.0, 0.0])));
}
