//! The splatting rasterizer on the scenes of other rasterizers' figures. Make them first (numpy is all it needs):
//!
//! ```text
//! python3 benches/gen_raster_scenes.py target/scenes S M L
//! cargo bench --bench raster
//! cargo bench --bench raster -- --quick "M front"     # only the table, only these lines
//! cargo bench --bench raster -- --quick --avx2         # with narrower vectors than the processor has
//! ```
//!
//! First a table: the least wall time of many frames on one and on two threads (into existing memory, into fresh memory,
//! and with the way back to the Gaussians' derivatives), and the thread time of each phase of the drawing. Then criterion's
//! statistics of the figures that the README gives.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints its results")]

#[path = "../tests/support/splat_scene.rs"]
mod splat_scene;

use criterion::Criterion;
use rayon::{ThreadPool, ThreadPoolBuilder};
use skinsplat_core::scene::{Camera, Gaussians, Image, OwnedPosed, Posed, PosedGradient, RenderedGradient};
use skinsplat_render::View;
use skinsplat_render::splat::{Derivatives, Phase, Renderer, SimdLevel, render};
use std::path::Path;
use std::time::{Duration, Instant};

const FOLDER: &str = "target/scenes";
const PHASES: [Phase; 5] = [Phase::Preprocess, Phase::Sort, Phase::Bin, Phase::Blend, Phase::Write];
/// Each line of the table takes about this long per thread count.
const BUDGET: Duration = Duration::from_millis(1500);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let level = arguments.iter().any(|a| a == "--avx2").then_some(SimdLevel::Avx2);
    let quick = arguments.iter().any(|a| a == "--quick");
    let chosen = |line: &str| {
        let mut patterns = arguments.iter().filter(|a| !a.starts_with("--")).peekable();
        patterns.peek().is_none() || patterns.any(|pattern| line.contains(pattern))
    };
    let cameras = cameras();
    println!(
        "scene view        threads   ms  fresh  +back |  thread ms: preprocess  sort   bin  blend  write"
    );
    for scene in ["S", "M", "L"] {
        let views: Vec<_> = cameras.iter().filter(|(view, ..)| chosen(&format!("{scene} {view}"))).collect();
        let Some(gaussians) = (!views.is_empty()).then(|| gaussians(scene)).flatten() else { continue };
        let posed = OwnedPosed::from_static(&gaussians);
        let posed = posed.as_posed();
        for (name, camera, background) in views {
            for threads in [1, 2] {
                let view = View::new(camera).over(*background);
                let frame = Frame { level, posed: &posed, view };
                let line = pool(threads).install(|| frame.measure());
                println!("{scene:5} {name:12} {threads:6} {line}");
            }
        }
    }
    if !quick {
        criterion(&cameras);
    }
}

fn criterion(cameras: &[(String, Camera, [f32; 3])]) {
    let mut criterion = Criterion::default().sample_size(30).configure_from_args();
    for (scene, at) in [("S", "front_512"), ("M", "front_1024")] {
        let Some(gaussians) = gaussians(scene) else { continue };
        let posed = OwnedPosed::from_static(&gaussians);
        let posed = posed.as_posed();
        let (_, camera, background) = cameras.iter().find(|(name, ..)| name == at).unwrap();
        let mut renderer = Renderer::new();
        let view = View::new(camera).over(*background);
        let pool = pool(2);
        criterion.bench_function(&format!("render/{scene}/{at}/2 threads"), |b| {
            b.iter(|| pool.install(|| renderer.render(&posed, &view).is_ok()));
        });
        let upstream = upstream(camera);
        let mut gradient = PosedGradient::default();
        criterion.bench_function(&format!("render and adjoint/{scene}/{at}/2 threads"), |b| {
            b.iter(|| {
                pool.install(|| {
                    renderer.render(&posed, &view).unwrap();
                    renderer.backward(&posed, &view, &upstream, &mut gradient, Derivatives::Exact).unwrap();
                });
            });
        });
    }
    criterion.final_summary();
}

struct Frame<'a> {
    level: Option<SimdLevel>,
    posed: &'a Posed<'a>,
    view: View<'a>,
}

impl Frame<'_> {
    /// One line of the table.
    fn measure(&self) -> String {
        let mut renderer = self.level.map_or_else(Renderer::new, |l| Renderer::with_simd_level(l).unwrap());
        let (posed, view) = (self.posed, self.view);
        let reused = least(|| {
            renderer.render(posed, &view).unwrap();
        });
        let fresh = least(|| drop(render(posed, &view).unwrap()));
        let upstream = upstream(view.camera);
        let mut gradient = PosedGradient::default();
        let back = least(|| {
            renderer.render(posed, &view).unwrap();
            renderer.backward(posed, &view, &upstream, &mut gradient, Derivatives::Exact).unwrap();
        });
        let mut phases = [f64::INFINITY; PHASES.len()];
        renderer.profile(true);
        least(|| {
            renderer.render(posed, &view).unwrap();
            let times = renderer.phase_times();
            for (least, phase) in phases.iter_mut().zip(PHASES) {
                *least = least.min(times.of(phase).as_secs_f64() * 1e3);
            }
        });
        let [preprocess, sort, bin, blend, write] = phases;
        format!(
            "{reused:6.2} {fresh:6.2} {back:6.2} | {preprocess:21.2} {sort:5.2} {bin:5.2} {blend:6.2} {write:6.2}"
        )
    }
}

/// Derivatives of the kind that a fit has: of every pixel and channel, of either sign.
fn upstream(camera: &Camera) -> RenderedGradient {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let value = |i: usize| ((i * 7919) % 2003) as f32 / 1001.0 - 1.0;
    let pixels = (0..width * height).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2)]).collect();
    RenderedGradient { image: Image::new(width, height, pixels).unwrap(), alpha: None }
}

/// The least time of a call, ms.
fn least(mut call: impl FnMut()) -> f64 {
    let (start, mut least) = (Instant::now(), f64::INFINITY);
    while start.elapsed() < BUDGET / 4 {
        let before = Instant::now();
        call();
        least = least.min(before.elapsed().as_secs_f64() * 1e3);
    }
    least
}

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

/// A scene, if it has been made.
fn gaussians(scene: &str) -> Option<Gaussians> {
    let path = Path::new(FOLDER).join(format!("scene_{scene}.ply"));
    if path.exists() {
        return Some(splat_scene::gaussians(&path));
    }
    println!("{} is missing: python3 benches/gen_raster_scenes.py {FOLDER} {scene}", path.display());
    None
}

fn cameras() -> Vec<(String, Camera, [f32; 3])> {
    let path = Path::new(FOLDER).join("cameras.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("{} is missing: python3 benches/gen_raster_scenes.py {FOLDER} S M", path.display());
        return Vec::new();
    };
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let view = |json: &serde_json::Value| {
        let (camera, background) = splat_scene::camera(json);
        (json["name"].as_str().unwrap().to_owned(), camera, background)
    };
    json["cameras"].as_array().unwrap().iter().map(view).collect()
}
