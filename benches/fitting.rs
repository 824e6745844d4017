//! One step of a fit (pose, render, loss with SSIM, both ways, Adam) on the embedded subject at 512 x 512.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, missing_docs, reason = "a benchmark")]

use criterion::{Criterion, criterion_group, criterion_main};
use skinsplat::datasets::Registry;
use skinsplat_fit::recipe::Poses;
use skinsplat_fit::train::{Trainer, start};
use skinsplat_fit::{FitOptions, Recipe};

fn steps(c: &mut Criterion) {
    let registry = Registry::embedded();
    let subject = registry.get("snapshot_ava").unwrap().load(&Default::default()).unwrap().remove(0);
    let training = &subject.train[0];
    let camera = &training.cameras[0];
    // The body's own vertices, then a finer surface.
    for edge_mm in [100, 14] {
        for recipe in [
            "animatable-skinned+sh_step=0.0",
            "animatable-skinned+sh_step=0.0+poses=refine+pose.from=0.0",
            "animatable-skinned+sh_degree=0",
        ] {
            let recipe = Recipe::parse(recipe).unwrap();
            let (degree, poses) =
                (recipe.sh_degree, if recipe.poses == Poses::Refine { ", poses" } else { "" });
            let options = FitOptions { recipe, iterations: u32::MAX, seed: 0, edge_mm };
            let mut trainer =
                Trainer::new(training, &options, start(training, &options).unwrap().avatar).unwrap();
            // Every frame is decoded once before the clock runs.
            for _ in 0..training.frames.len() {
                trainer.step().unwrap();
            }
            let count = trainer.avatar().gaussians.len();
            let size = format!("{}x{}", camera.width, camera.height);
            c.bench_function(&format!("step/{count} Gaussians, degree {degree}{poses}, {size}"), |b| {
                b.iter(|| trainer.step().unwrap());
            });
        }
    }
}

criterion_group! { name = benches; config = Criterion::default().sample_size(30); targets = steps }
criterion_main!(benches);
