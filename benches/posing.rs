//! Cost of posing per Gaussian, one thread: every preset at SH degree 0 and 3, into fresh memory (`pose`) and into that of
//! the pose before (`pose-into`); of walking it backwards (`pose-backward`) and of taking over changed parameters
//! (`update`).
//! `cargo bench --bench posing`; the time per element is the time per Gaussian. Forward kinematics and the skinned mesh
//! are not counted.
#![allow(missing_docs, clippy::unwrap_used, clippy::disallowed_methods, reason = "benchmark")]

mod rig;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{Mat3, Vec3};
use skinsplat_core::scene::{AvatarGradient, Binding, Posed, PosedBody, PosedGradient};
use skinsplat_posing::needs::{Needs, PoseBounds};
use skinsplat_posing::{BoundAvatar, PRESETS, PoseOptions, Poser, Strategy, pose};
use std::hint::black_box;

fn posing(c: &mut Criterion) {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::pose(&body)).unwrap();
    posed_body.mesh();
    for degree in [0, 3] {
        for (name, avatar) in [
            ("14k-vertices", rig::on_vertices(&body, degree)),
            ("100k-vertices", rig::scattered(&body, degree)),
            ("100k-faces", rig::on_faces(&body, degree)),
        ] {
            let case = format!("{name}/degree-{degree}");
            let bound = BoundAvatar::new(&avatar, &body).unwrap();
            each_preset(c, &format!("pose/{case}"), bound.len(), |strategy| {
                black_box(pose(&bound, &posed_body, strategy).unwrap());
            });
            let (mut poser, options) = (Poser::new(), PoseOptions::default());
            each_preset(c, &format!("pose-into/{case}"), bound.len(), |strategy| {
                black_box(poser.pose(&bound, &posed_body, strategy, &options).unwrap());
            });
            let upstream = upstream(&pose(&bound, &posed_body, &PRESETS[0].strategy).unwrap().as_posed());
            let mut gradient = AvatarGradient::default();
            gradient.reset(&avatar.gaussians, matches!(avatar.binding, Binding::Face(_)));
            each_preset(c, &format!("pose-backward/{case}"), bound.len(), |strategy| {
                let gaussians = &avatar.gaussians;
                poser
                    .backward(&bound, &posed_body, strategy, &options, gaussians, &upstream, &mut gradient)
                    .unwrap();
            });
        }
    }
}

/// Runs something with the strategy of every preset on one thread.
fn each_preset(c: &mut Criterion, name: &str, n: usize, mut run: impl FnMut(&Strategy) + Send) {
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(n as u64));
    for preset in PRESETS {
        group.bench_function(BenchmarkId::from_parameter(preset.id), |b| {
            one_thread.install(|| b.iter(|| run(&preset.strategy)));
        });
    }
}

/// Some derivative of every entry of a pose.
fn upstream(posed: &Posed<'_>) -> PosedGradient {
    let mut gradient = PosedGradient::default();
    gradient.reset(posed);
    let mut noise = rig::Noise(3);
    let mut next = || noise.next() as f32;
    gradient.means.iter_mut().for_each(|g| *g = Vec3::new(next(), next(), next()));
    gradient.factors.iter_mut().for_each(|g| *g = Mat3::from_cols_array(&[0; 9].map(|_| next())));
    gradient.opacities.iter_mut().for_each(|g| *g = next());
    gradient.sh.iter_mut().for_each(|g| *g = [next(), next(), next()]);
    gradient
}

/// The exact average, what is cheaper than it, and the other solvers: the costs that `needs` refers to.
fn candidates(c: &mut Criterion) {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::pose(&body)).unwrap();
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let bound = BoundAvatar::new(&rig::scattered(&body, 0), &body).unwrap();
    let base = Strategy::preset("quaternion-average").unwrap();
    let mut group = c.benchmark_group("candidates");
    group.throughput(Throughput::Elements(bound.len() as u64));
    for rotation in Needs::listed() {
        let (strategy, mut poser) = (Strategy { rotation, ..base }, Poser::new());
        group.bench_function(BenchmarkId::from_parameter(rotation), |b| {
            one_thread.install(|| {
                b.iter(|| {
                    black_box(poser.pose(&bound, &posed_body, &strategy, &PoseOptions::default()).unwrap());
                });
            });
        });
    }
    group.throughput(Throughput::Elements(1));
    group.bench_function("bounds-of-a-pose", |b| b.iter(|| black_box(PoseBounds::new(&bound, &posed_body))));
}

fn updating(c: &mut Criterion) {
    let body = rig::body();
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut group = c.benchmark_group("update");
    for degree in [0, 3] {
        for (name, avatar) in [
            ("14k-vertices", rig::on_vertices(&body, degree)),
            ("100k-vertices", rig::scattered(&body, degree)),
            ("100k-faces", rig::on_faces(&body, degree)),
        ] {
            let mut bound = BoundAvatar::new(&avatar, &body).unwrap();
            group.throughput(Throughput::Elements(bound.len() as u64));
            group.bench_function(BenchmarkId::new(name, degree), |b| {
                one_thread.install(|| b.iter(|| bound.update(black_box(&avatar)).unwrap()));
            });
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

criterion_group!(benches, posing, candidates, updating, binding);
criterion_main!(benches);
