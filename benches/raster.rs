//! temp
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout, reason = "temp")]
#[path = "../tests/support/splat_scene.rs"]
mod splat_scene;
use skinsplat::render::splat::*;
use skinsplat::scene::*;
use std::time::Instant;
fn main() {
    let cams: serde_json::Value =
        serde_json::from_slice(&std::fs::read("target/scenes/cameras.json").unwrap()).unwrap();
    let level = match std::env::var("LEVEL").as_deref() {
        Ok("avx2") => SimdLevel::Avx2,
        _ => SimdLevel::Avx512,
    };
    let only = std::env::var("ONLY").unwrap_or_default();
    let reps: usize = std::env::var("REPS").ok().map_or(60, |v| v.parse().unwrap());
    for scene in ["S", "M", "L"] {
        if !only.is_empty() && !only.starts_with(scene) {
            continue;
        }
        let g = splat_scene::gaussians(format!("target/scenes/scene_{scene}.ply").as_ref());
        let posed = Posed::from_static(&g);
        for cam in cams["cameras"].as_array().unwrap() {
            let name = cam["name"].as_str().unwrap();
            if !only.is_empty() && !format!("{scene} {name}").starts_with(&only) {
                continue;
            }
            let (camera, background) = splat_scene::camera(cam);
            let settings = RenderSettings { background, antialiased: false };
            for threads in std::env::var("THREADS").map_or(vec![1, 2], |v| vec![v.parse().unwrap()]) {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut r = Renderer::with_simd_level(level).unwrap();
                    let mut out = r.render(&posed, &camera, &settings);
                    let (mut best, mut fresh) = (f64::MAX, f64::MAX);
                    for _ in 0..reps {
                        let t = Instant::now();
                        r.render_into(&posed, &camera, &settings, &mut out);
                        best = best.min(t.elapsed().as_secs_f64());
                    }
                    for _ in 0..if std::env::var("QUICK").is_ok() {0} else {reps / 4} {
                        let t = Instant::now();
                        let o = r.render(&posed, &camera, &settings);
                        fresh = fresh.min(t.elapsed().as_secs_f64());
                        drop(o);
                    }
                    let mut p = [f64::MAX; 5];
                    for _ in 0..if std::env::var("QUICK").is_ok() {0} else {reps / 4} {
                        let t = r.render_profiled(&posed, &camera, &settings, &mut out);
                        for (i, ph) in [Phase::Preprocess, Phase::Sort, Phase::Bin, Phase::Blend, Phase::Write].into_iter().enumerate() {
                            p[i] = p[i].min(t.of(ph).as_secs_f64() * 1e3);
                        }
                    }
                    println!("{scene} {name} threads {threads}: {:.2} ms (fresh {:.2})  pre {:.2} sort {:.2} bin {:.2} blend {:.2} write {:.2}", best * 1e3, fresh*1e3, p[0], p[1], p[2], p[3], p[4]);
                });
            }
        }
    }
}
