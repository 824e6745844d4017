//! Scores a render against its truth under a named protocol.
//!
//! ```text
//! cargo run -p skinsplat-metrics --example score_two_images
//! cargo run -p skinsplat-metrics --features alex --example score_two_images -- render.png truth.png hugs-full
//! ```
//!
//! Without files it makes two images. LPIPS is computed with the feature `alex`.
#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "an example")]

use skinsplat_core::scene::Image;
use skinsplat_metrics::{FrameScore, MetricId, MetricsError, Protocol, Truth, Wanted};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (render, truth) = match &arguments[..] {
        [] => (pattern(0.05)?, pattern(0.0)?),
        [render, truth, ..] => (read(render)?, read(truth)?),
        [_] => return Err("one file; expected RENDER TRUTH [PROTOCOL], or none".into()),
    };
    let protocol = Protocol::parse(arguments.get(2).map_or("default", String::as_str))?;
    let score = score(&protocol, &render, &truth)?;
    println!("under {} ({})", score.protocol, protocol.title);
    for (id, value) in score.values.iter() {
        let metric = id.metric();
        println!("{:6} {value:.digits$} {}", metric.title, metric.unit, digits = metric.decimals);
    }
    for (id, reason) in &score.not_computed {
        println!("{:6} not computed: {reason}", id.title());
    }
    Ok(())
}

/// Every metric of two images, with LPIPS by the built-in network.
#[cfg(feature = "alex")]
fn score(protocol: &Protocol, render: &Image, truth: &Image) -> Result<FrameScore, MetricsError> {
    use skinsplat_metrics::lpips::{OneFrame, weights::Networks};
    let networks = Networks::default();
    let metrics: Vec<MetricId> = MetricId::of_images().collect();
    let wanted = Wanted { lpips: Some(&OneFrame::new(&networks)), ..Wanted::of(&metrics) };
    protocol.score_with(render, Truth::Composited { rgb: truth, mask: None }, wanted)
}

/// Every metric of two images; LPIPS is asked for and says why it is not there.
#[cfg(not(feature = "alex"))]
fn score(protocol: &Protocol, render: &Image, truth: &Image) -> Result<FrameScore, MetricsError> {
    let metrics: Vec<MetricId> = MetricId::of_images().collect();
    protocol.score_with(render, Truth::Composited { rgb: truth, mask: None }, Wanted::of(&metrics))
}

/// A smooth pattern of 96 x 64 pixels; `phase` shifts it.
fn pattern(phase: f32) -> Result<Image, Box<dyn Error>> {
    let pixel = |i: usize| {
        let (x, y) = ((i % 96) as f32, (i / 96) as f32);
        [0.11, 0.17, 0.23].map(|f| 0.5 + 0.4 * (x * f + phase).sin() * (y * f).cos())
    };
    Ok(Image::new(96, 64, (0..96 * 64).map(pixel).collect())?)
}

/// The colours of an image file as values in \[0, 1\].
fn read(path: &str) -> Result<Image, Box<dyn Error>> {
    let file = image::open(path).map_err(|error| format!("{path}: {error}"))?.to_rgb32f();
    let (width, height) = file.dimensions();
    let pixels = file.pixels().map(|pixel| pixel.0).collect();
    Ok(Image::new(width as usize, height as usize, pixels)?)
}
