//! Draws a ring of coloured Gaussians around a triangle, and writes `splats.ppm`.
//!
//! `cargo run --example draw_splats [FILE.ppm]`
#![expect(clippy::disallowed_methods, reason = "an example")]

use glam::{DVec3, Mat3, Quat, Vec3};
use skinsplat_core::scene::{Camera, Image, OwnedPosed};
use skinsplat_render::mesh::{self, Mesh, SamplePattern};
use skinsplat_render::{View, splat};
use std::f32::consts::TAU;
use std::io::Write;

/// Of the constant spherical harmonic.
const C0: f32 = 0.282_094_8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "splats.ppm".to_owned());
    let camera = Camera::look_at(DVec3::new(0.0, 1.2, 3.0), DVec3::ZERO, DVec3::Y, 500.0, 480, 360);
    let corners = [Vec3::new(-0.6, -0.4, 0.0), Vec3::new(0.6, -0.4, 0.0), Vec3::new(0.0, 0.7, 0.0)];
    let triangle = Mesh::new(&corners, &[[0, 1, 2]])?;
    let drawing = mesh::draw(&triangle, &camera, SamplePattern::new(4), |fragment| fragment.barycentric)?;
    let view = View::new(&camera).over([1.0; 3]).with_underlay(Some(drawing.underlay()));
    write_ppm(&path, &splat::render(&ring(60).as_posed(), &view)?.image)?;
    Ok(())
}

/// Needles along a circle about the vertical axis: some in front of the triangle, some behind.
fn ring(count: usize) -> OwnedPosed {
    let angles = || (0..count).map(move |i| TAU * i as f32 / count as f32);
    let scales = Mat3::from_diagonal(Vec3::new(0.02, 0.02, 0.06));
    let hue = |angle: f32| [0.0, TAU / 3.0, 2.0 * TAU / 3.0].map(|shift| 0.5 * (angle - shift).cos() / C0);
    OwnedPosed {
        means: angles().map(|a| Vec3::new(a.sin(), 0.1 * (3.0 * a).sin(), a.cos()) * 0.8).collect(),
        factors: angles().map(|a| Mat3::from_quat(Quat::from_rotation_y(a + TAU / 4.0)) * scales).collect(),
        opacities: vec![0.9; count],
        sh_degree: 0,
        sh: angles().map(hue).collect(),
        ..OwnedPosed::default()
    }
}

/// A binary PPM of 8 bits.
fn write_ppm(path: &str, image: &Image) -> std::io::Result<()> {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    write!(file, "P6\n{} {}\n255\n", image.width(), image.height())?;
    let bytes = image.pixels().as_flattened().iter().map(|&v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
    file.write_all(&bytes.collect::<Vec<u8>>())?;
    file.flush()
}
