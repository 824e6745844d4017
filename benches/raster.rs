//! The splatting rasterizer on the scenes of other rasterizers' figures. Make them first (numpy is all it needs):
//!
//! ```text
//! python3 benches/gen_raster_scenes.py target/scenes S M L
//! cargo bench --bench raster
//! cargo bench --bench raster -- --quick M     # only the table, only scene M
//! ```
//!
//! First a table: the least wall time of many frames on one and on two threads (into existing memory, and into fresh
//! memory), and the thread time of each phase. Then criterion's statistics of the two figures that the README gives.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints its results")]

#[path = "../tests/support/splat_scene.rs"]
mod splat_scene;

use criterion::Criterion;
use rayon::{ThreadPool, ThreadPoolBuilder};
use skinsplat::render::splat::{Phase, PhaseTimes, RenderSettings, Renderer};
use skinsplat::scene::{Camera, Gaussians, Posed, Rendered};
use std::path::Path;
use std::time::{Duration, Instant};

const FOLDER: &str = "target/scenes";
const PHASES: [Phase; 5] = [Phase::Preprocess, Phase::Sort, Phase::Bin, Phase::Blend, Phase::Write];
/// Each line of the table takes about this long per thread count.
const BUDGET: Duration = Duration::from_secs(3);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let quick = arguments.iter().any(|a| a == "--quick");
    let chosen = |scene: &str| {
        let mut names = arguments.iter().filter(|a| !a.starts_with("--")).peekable();
        names.peek().is_none() || names.any(|name| name == scene)
    };
    let cameras = cameras();
    println!("scene view        threads   ms  fresh |  thread ms: preprocess  sort   bin  blend  write");
    for scene in ["S", "M", "L"].into_iter().filter(|scene| chosen(scene)) {
        let Some(gaussians) = gaussians(scene) else { continue };
        let posed = Posed::from_static(&gaussians);
        for (view, camera, settings) in &cameras {
            for threads in [1, 2] {
                let frame = Frame { posed: &posed, camera, settings };
                let line = pool(threads).install(|| frame.measure());
                println!("{scene:5} {view:12} {threads:6} {line}");
            }
        }
    }
    if !quick {
        criterion(&cameras);
    }
}

fn criterion(cameras: &[(String, Camera, RenderSettings)]) {
    let mut criterion = Criterion::default().sample_size(30).configure_from_args();
    for (scene, view) in [("S", "front_512"), ("M", "front_1024")] {
        let Some(gaussians) = gaussians(scene) else { continue };
        let posed = Posed::from_static(&gaussians);
        let (_, camera, settings) = cameras.iter().find(|(name, ..)| name == view).unwrap();
        let mut renderer = Renderer::new();
        let mut rendered = renderer.render(&posed, camera, settings);
        let pool = pool(2);
        criterion.bench_function(&format!("render/{scene}/{view}/2 threads"), |b| {
            b.iter(|| pool.install(|| renderer.render_into(&posed, camera, settings, &mut rendered)));
        });
    }
    criterion.final_summary();
}

struct Frame<'a> {
    posed: &'a Posed<'a>,
    camera: &'a Camera,
    settings: &'a RenderSettings,
}

impl Frame<'_> {
    /// One line of the table.
    fn measure(&self) -> String {
        let mut renderer = Renderer::new();
        let mut rendered: Rendered = renderer.render(self.posed, self.camera, self.settings);
        let reused = least(|| renderer.render_into(self.posed, self.camera, self.settings, &mut rendered));
        let fresh = least(|| drop(renderer.render(self.posed, self.camera, self.settings)));
        let mut phases = [f64::INFINITY; PHASES.len()];
        least(|| {
            let times: PhaseTimes =
                renderer.render_profiled(self.posed, self.camera, self.settings, &mut rendered);
            for (least, phase) in phases.iter_mut().zip(PHASES) {
                *least = least.min(times.of(phase).as_secs_f64() * 1e3);
            }
        });
        let [preprocess, sort, bin, blend, write] = phases;
        format!("{reused:6.2} {fresh:6.2} | {preprocess:21.2} {sort:5.2} {bin:5.2} {blend:6.2} {write:6.2}")
    }
}

/// The least time of a call, ms.
fn least(mut call: impl FnMut()) -> f64 {
    let (start, mut least) = (Instant::now(), f64::INFINITY);
    while start.elapsed() < BUDGET / 3 {
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

fn cameras() -> Vec<(String, Camera, RenderSettings)> {
    let path = Path::new(FOLDER).join("cameras.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("{} is missing: python3 benches/gen_raster_scenes.py {FOLDER} S M", path.display());
        return Vec::new();
    };
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let view = |json: &serde_json::Value| {
        let (camera, background) = splat_scene::camera(json);
        (json["name"].as_str().unwrap().to_owned(), camera, RenderSettings { background, antialiased: false })
    };
    json["cameras"].as_array().unwrap().iter().map(view).collect()
}
