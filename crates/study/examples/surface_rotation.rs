//! How far strategies carry a Gaussian from where the posed surface goes, by how far the joints under it bend.
//!
//! `cargo run --release -p skinsplat-study --example surface_rotation -- BODY.npz POSES.npz`
//!
//! Per face F maps the two rest edges and the unit normal to the posed ones. Rows: the angle between a strategy's rotation and
//! the rotation nearest to F, and the affine-invariant distance (the root of Σ log² of the generalised eigenvalues) between
//! the covariance of a disc in the face, ten times as wide as thick, carried by the strategy and by F. Faces are weighted by
//! their area at rest and grouped by the widest angle between joints with a weight above 0.05 in the middle of the face.
#![expect(clippy::print_stdout, reason = "an example")]

use glam::{DMat3, DQuat, DVec3, Vec3};
use skinsplat_core::math::{portable, rotation};
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, PosedBody, RestBody};
use skinsplat_data::{body, poses};
use skinsplat_posing::{BoundAvatar, Strategy, pose};
use std::error::Error;
use std::path::Path;

/// Upper ends of the groups, degrees; the last is open.
const GROUPS: [f64; 7] = [5.0, 15.0, 30.0, 60.0, 90.0, 120.0, f64::INFINITY];

/// Least weight of a joint whose angle counts.
const WEIGHT: f64 = 0.05;

/// Thickness of the disc over its width.
const THIN: f64 = 0.1;

/// What is compared: the strategy, and what its row is called.
const STRATEGIES: [(&str, &str); 7] = [
    ("quaternion-average", "quaternion average"),
    ("lbs", "Gram-Schmidt of B"),
    ("quaternion-average+covariance=affine", "affine B"),
    ("face-tbn", "frame of the face"),
    ("push-forward", "push-forward, weights constant across"),
    ("push-forward-normal", "push-forward, thickness kept"),
    ("push-forward-normal+covariance=rotate", "rotation nearest to the push-forward"),
];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, motion] = arguments.as_slice() else {
        return Err("expected two files: a body model and poses".into());
    };
    let track = poses::load(Path::new(motion))?;
    let (rest, _) = body::shape(&body::load(Path::new(model))?, &track.betas, &track.expression)?;
    let poses = track.poses(&rest.skeleton)?;
    let bound = BoundAvatar::new(&probes(&rest), &rest)?;
    let mut angles = vec![Groups::default(); STRATEGIES.len()];
    let mut distances = vec![Groups::default(); STRATEGIES.len()];
    for at in poses.iter() {
        let posed_body = PosedBody::new(&rest, at)?;
        let faces = carried(&posed_body);
        for (k, (id, _)) in STRATEGIES.iter().enumerate() {
            let strategy: Strategy = id.parse()?;
            let posed = pose(&bound, &posed_body, &strategy)?;
            for (face, factor) in faces.iter().zip(&posed.factors) {
                let own = factor.as_dmat3();
                let [found, exact] = [own, face.exact].map(rotation::nearest_rotation);
                angles[k].add(face, portable::angle_between(found, exact).to_degrees());
                distances[k].add(face, distance(face.exact * face.disc, own * face.disc));
            }
        }
    }
    print("Degrees between the strategy's rotation and that of the surface, median / 95 %", &mut angles);
    print("Distance of the disc's covariance from the exact one, median / 95 %", &mut distances);
    Ok(())
}

/// A Gaussian in the middle of each face whose canonical factor is the identity, so that the posed one is what carries it.
fn probes(body: &RestBody) -> Avatar {
    let n = body.faces.len();
    let gaussians = Gaussians {
        means: vec![Vec3::ZERO; n],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
        log_scales: vec![Vec3::ZERO; n],
        opacity_logits: vec![0.0; n],
        sh_degree: 0,
        sh: vec![[0.0; 3]; n],
    };
    let binding = FaceBinding {
        faces: (0..n as u32).collect(),
        barycentric: vec![[1.0 / 3.0; 3]; n],
        offsets: vec![0.0; n],
    };
    Avatar { gaussians, binding: Binding::Face(binding) }
}

/// A face in one pose.
struct Carried {
    /// F.
    exact: DMat3,
    /// The factor of the disc at rest.
    disc: DMat3,
    area: f64,
    /// Degrees.
    bend: f64,
}

fn carried(body: &PosedBody<'_>) -> Vec<Carried> {
    let posed = &body.mesh().vertices;
    let frame = |[a, b, c]: [DVec3; 3]| {
        let (u, v) = (b - a, c - a);
        DMat3::from_cols(u, v, u.cross(v).normalize())
    };
    let of_face = |(face, corners): (usize, &[u32; 3])| {
        let rest = frame(corners.map(|v| body.rest.vertices[v as usize]));
        let normal = rest.z_axis;
        let (first, second) = normal.any_orthonormal_pair();
        Carried {
            exact: frame(corners.map(|v| posed[v as usize].as_dvec3())) * rest.inverse(),
            disc: DMat3::from_cols(first, second, normal * THIN),
            area: 0.5 * rest.x_axis.cross(rest.y_axis).length(),
            bend: widest(body, face),
        }
    };
    body.rest.faces.iter().enumerate().map(of_face).collect()
}

/// The widest angle between two joints that count, degrees.
fn widest(body: &PosedBody<'_>, face: usize) -> f64 {
    let weights = body.rest.weights_at(face as u32, [1.0 / 3.0; 3]);
    let joints: Vec<DQuat> = weights
        .into_iter()
        .filter(|(_, weight)| f64::from(*weight) > WEIGHT)
        .map(|(joint, _)| body.joints[joint].rotation)
        .collect();
    let mut widest = 0.0f64;
    for (i, a) in joints.iter().enumerate() {
        for b in &joints[..i] {
            widest = widest.max(portable::angle_between(*a, *b).to_degrees());
        }
    }
    widest
}

/// Between the covariances A Aᵀ and B Bᵀ.
fn distance(a: DMat3, b: DMat3) -> f64 {
    let x = a.inverse() * b;
    let squares = eigenvalues(x.transpose() * x);
    squares.map(|v| portable::ln(v.max(f64::MIN_POSITIVE))).iter().map(|l| l * l).sum::<f64>().sqrt()
}

/// Of a symmetric matrix (Smith 1961).
fn eigenvalues(m: DMat3) -> [f64; 3] {
    let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
    let shifted = m - DMat3::from_diagonal(DVec3::splat(mean));
    let squares: f64 = shifted.to_cols_array().iter().map(|c| c * c).sum();
    let p = (squares / 6.0).sqrt();
    if p == 0.0 {
        return [mean; 3];
    }
    let half = (shifted * (1.0 / p)).determinant() / 2.0;
    let angle = portable::acos(half.clamp(-1.0, 1.0)) / 3.0;
    let third = 2.0 * std::f64::consts::FRAC_PI_3;
    let largest = mean + 2.0 * p * portable::cos(angle);
    let least = mean + 2.0 * p * portable::cos(angle + third);
    [largest, 3.0 * mean - largest - least, least]
}

/// Values and their areas, by bend.
#[derive(Clone, Default)]
struct Groups([Vec<(f64, f64)>; GROUPS.len()]);

impl Groups {
    fn add(&mut self, face: &Carried, value: f64) {
        let group = GROUPS.iter().position(|end| face.bend < *end);
        if let (Some(group), true) = (group, value.is_finite()) {
            self.0[group].push((value, face.area));
        }
    }

    /// The value below which a share of the area lies.
    fn quantile(&mut self, group: usize, share: f64) -> Option<f64> {
        let values = &mut self.0[group];
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = values.iter().map(|(_, area)| area).sum();
        let mut below = 0.0;
        let reaches = |(_, area): &&(f64, f64)| {
            below += area;
            below >= share * total
        };
        values.iter().find(reaches).map(|(value, _)| *value)
    }
}

fn print(title: &str, rows: &mut [Groups]) {
    println!("\n{title}\n");
    let heads: Vec<String> = GROUPS.windows(2).map(|ends| format!("{} to {}", ends[0], ends[1])).collect();
    println!("| widest joint angle | {} |", heads.join(" | ").replace("to inf", "and more"));
    println!("|---|{}", "---|".repeat(heads.len()));
    for ((_, name), groups) in STRATEGIES.iter().zip(rows) {
        let cell = |group: usize, groups: &mut Groups| match [0.5, 0.95].map(|p| groups.quantile(group, p)) {
            [Some(median), Some(most)] => format!("{median:.2} / {most:.1}"),
            _ => "no face".to_owned(),
        };
        let cells: Vec<String> = (1..GROUPS.len()).map(|group| cell(group, groups)).collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
}
