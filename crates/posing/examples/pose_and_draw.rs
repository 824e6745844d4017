//! A made-up avatar, posed under two strategies and drawn side by side into a picture (PPM).
//!
//! `cargo run -p skinsplat-posing --example pose_and_draw -- elbow.ppm`
#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "an example")]

use glam::{DVec3, Vec3};
use skinsplat_core::scene::{
    Avatar, Binding, Camera, Gaussians, Pose, PosedBody, RestBody, SceneError, Skeleton, SkinWeights,
};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy};
use skinsplat_render::View;
use skinsplat_render::splat::Renderer;
use std::error::Error;
use std::fmt::Write as _;

/// Pixels of a panel.
const SIDE: usize = 160;

/// Gaussians along the sleeve and around it.
const RINGS: usize = 60;
const AROUND: usize = 24;

/// A sleeve along x over two bones that meet at the origin: flat splats in stripes.
fn sleeve() -> Result<(RestBody, Avatar), SceneError> {
    let names = ["upper", "lower"].map(str::to_owned).to_vec();
    let skeleton = Skeleton::from_joint_positions(names, vec![None, Some(0)], &[-DVec3::X, DVec3::ZERO])?;
    let mut gaussians = Gaussians::default();
    let mut rows = Vec::new();
    for i in 0..RINGS * AROUND {
        let (ring, angle) = (i / AROUND, (i % AROUND) as f32 / AROUND as f32 * std::f32::consts::TAU);
        let x = ring as f32 / RINGS as f32 * 2.0 - 1.0;
        gaussians.means.push(Vec3::new(x, 0.25 * angle.cos(), 0.25 * angle.sin()));
        let (sine, cosine) = (0.5 * angle).sin_cos();
        gaussians.rotations.push([cosine, sine, 0.0, 0.0]);
        gaussians.log_scales.push(Vec3::new(0.03, 0.004, 0.05).map(f32::ln));
        gaussians.opacity_logits.push(3.0);
        gaussians.sh.push(if ring / 4 % 2 == 0 { [1.2, -0.8, -0.8] } else { [-0.8, 0.4, 1.2] });
        let lower = (0.5 + 1.5 * x).clamp(0.0, 1.0);
        rows.push([(0, 1.0 - lower), (1, lower)]);
    }
    let weights = SkinWeights::from_rows(rows, 2)?;
    let vertices = gaussians.means.iter().map(|mean| mean.as_dvec3()).collect();
    let (faces, uv, pose_directions) = (Vec::new(), None, Vec::new());
    let body = RestBody { skeleton, vertices, faces, weights: weights.clone(), uv, pose_directions };
    Ok((body, Avatar { gaussians, binding: Binding::Vertex(weights) }))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (body, avatar) = sleeve()?;
    let bound = BoundAvatar::new(&avatar, &body)?;
    let bend = [DVec3::ZERO, DVec3::new(1.2, 0.0, 1.6)];
    let posed_body = PosedBody::new(&body, &Pose::from_axis_angles(&body.skeleton, &bend, DVec3::ZERO))?;
    let side = SIDE as u32;
    let camera = Camera::look_at(DVec3::new(0.0, 0.6, 3.0), DVec3::Y * 0.3, DVec3::Y, 170.0, side, side);
    let view = View::new(&camera).over([1.0; 3]);
    let options = PoseOptions { seen_by: Some(&camera), ..PoseOptions::default() };
    let (mut poser, mut renderer) = (Poser::new(), Renderer::new());
    let mut panels = Vec::new();
    for spec in ["lbs", "quaternion-average"] {
        let strategy: Strategy = spec.parse()?;
        let posed = poser.pose(&bound, &posed_body, &strategy, &options)?;
        let image = renderer.render(&posed, &view)?.image.clone();
        let sum = image.pixels().iter().fold(Vec3::ZERO, |sum, &rgb| sum + Vec3::from_array(rgb));
        println!("{spec}: {} Gaussians, mean colour {:.4}", posed.len(), sum / (SIDE * SIDE) as f32);
        panels.push(image);
    }
    let Some(path) = std::env::args().nth(1) else { return Ok(()) };
    let mut ppm = format!("P3\n{} {SIDE}\n255\n", SIDE * panels.len());
    for pixel in (0..SIDE).flat_map(|y| panels.iter().flat_map(move |p| (0..SIDE).map(move |x| p.at(x, y)))) {
        let [r, g, b] = pixel.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
        writeln!(ppm, "{r} {g} {b}")?;
    }
    Ok(std::fs::write(path, ppm)?)
}
