//! Time of the metrics of one 512 x 512 frame on one core: every variant of `reproduce score`, single SSIMs, the default
//! protocol, and LPIPS with AlexNet, of a pair and of a second render against a truth that was seen. `cargo bench --bench metrics`.
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    missing_docs,
    reason = "benchmark; criterion_group! makes undocumented functions"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use skinsplat_core::scene::{Image, Mask};
use skinsplat_metrics::lpips::OneFrame;
use skinsplat_metrics::lpips::weights::Networks;
use skinsplat_metrics::ssim::ssim_of_planes;
use skinsplat_metrics::{
    LpipsVariant, PerceptualDistance, Planes, Protocol, SsimVariant, Truth, all_variants,
};
use std::hint::black_box;

const SIZE: usize = 512;

/// A smooth pattern with some texture; `phase` shifts it.
fn image(phase: f32) -> Image {
    let pixel = |i: usize| {
        let (x, y) = ((i % SIZE) as f32, (i / SIZE) as f32);
        [0.031, 0.047, 0.113].map(|f| 0.5 + 0.5 * ((x * f + phase).sin() * (y * f).cos()))
    };
    Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(pixel).collect()).unwrap()
}

fn metrics(c: &mut Criterion) {
    let (render, truth) = (image(0.05), image(0.0));
    let mask = Mask::filled(SIZE, SIZE, 1.0);
    let planes = [&render, &truth].map(|image| Planes::new(image, "image").unwrap());
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut group = c.benchmark_group("512x512_one_core");
    let mut bench = |name: &str, run: &(dyn Fn() + Sync)| {
        group.bench_function(name, |b| b.iter(|| one_core.install(run)));
    };
    bench("all_variants", &|| {
        black_box(all_variants(&render, &truth, None).unwrap());
    });
    bench("planes_of_one_image", &|| {
        black_box(Planes::new(&render, "image").unwrap());
    });
    for variant in SsimVariant::ALL {
        let settings = variant.settings();
        bench(variant.id(), &|| {
            black_box(ssim_of_planes(&planes[0], &planes[1], &settings, variant.id(), None).unwrap());
        });
    }
    let protocol = Protocol::default();
    bench("default_protocol", &|| {
        let truth = Truth::Straight { rgb: &truth, alpha: &mask };
        black_box(protocol.score(&render, truth).unwrap());
    });
    let (networks, variant) = (Networks::default(), LpipsVariant::ALL[0]);
    let other = Planes::new(&image(0.1), "image").unwrap();
    bench("lpips_alex", &|| {
        black_box(OneFrame::new(&networks).distance(&planes[0], &planes[1], variant).unwrap());
    });
    bench("lpips_alex_two_renders_of_a_truth", &|| {
        let frame = OneFrame::new(&networks);
        for render in [&planes[0], &other] {
            black_box(frame.distance(render, &planes[1], variant).unwrap());
        }
    });
}

criterion_group!(benches, metrics);
criterion_main!(benches);
