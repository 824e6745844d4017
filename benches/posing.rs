//! Cost of posing per Gaussian, one thread: every preset at SH degree 0 and 3.
//! `cargo bench --bench posing`; the time per element is the time per Gaussian. Forward kinematics and the skinned mesh
//! are not counted.
#![allow(missing_docs, clippy::unwrap_used, reason = "benchmark")]

mod rig;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use skinsplat::scene::PosedBody;
use skinsplat::strategy::{BoundAvatar, PRESETS, pose};
use std::hint::black_box;

fn posing(c: &mut Criterion) {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::pose(&body)).unwrap();
    posed_body.mesh();
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for degree in [0, 3] {
        for (name, avatar) in [
            ("14k-vertices", rig::on_vertices(&body, degree)),
            ("100k-vertices", rig::scattered(&body, degree)),
            ("100k-faces", rig::on_faces(&body, degree)),
        ] {
            let bound = BoundAvatar::new(&avatar, &body).unwrap();
            let mut group = c.benchmark_group(format!("pose/{name}/degree-{degree}"));
            group.throughput(Throughput::Elements(bound.len() as u64));
            for preset in PRESETS {
                group.bench_function(BenchmarkId::from_parameter(preset.id), |b| {
                    one_thread.install(|| {
                        b.iter(|| black_box(pose(&bound, &posed_body, &preset.strategy).unwrap()));
                    });
                });
            }
        }
    }
}

fn binding(c: &mut Criterion) {
    let body = rig::body();
    let avatar = rig::scattered(&body, 0);
    c.benchmark_group("bind")
        .sample_size(10)
        .bench_function("100k-nearest-faces", |b| b.iter(|| BoundAvatar::new(&avatar, &body).unwrap()));
}

criterion_group!(benches, posing, binding);
criterion_main!(benches);
