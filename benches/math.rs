//! Cost per Gaussian of the kernels of layer 0. `cargo bench --bench math`.
#![allow(missing_docs, clippy::disallowed_methods, reason = "benchmark")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use skinsplat_core::math::average::{Solver, Start, average_rotation, lanes, two_bones};
use skinsplat_core::math::rotation::{normalize, quaternion_to_matrix_raw};
use skinsplat_core::math::{Quaternion, Real, sh};
use std::hint::black_box;

/// A multiple of every lane count, small enough for the first-level cache.
const COUNT: usize = 256;

/// Deterministic numbers in \[-1, 1).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A rotation by up to about `spread` radians.
    fn quaternion<T: Real>(&mut self, spread: f64) -> Quaternion<T> {
        let q = [1.0, 0.3 * spread * self.next(), 0.3 * spread * self.next(), 0.3 * spread * self.next()];
        normalize(q).unwrap_or(q).map(T::from_f64)
    }
}

/// `bones` rotations within about 90 degrees of each other, and weights, per Gaussian.
fn problems<T: Real>(bones: usize) -> Vec<(Vec<Quaternion<T>>, Vec<T>)> {
    let mut noise = Noise(7);
    let weights = |noise: &mut Noise| (0..bones).map(|_| T::from_f64(noise.next().abs() + 0.05)).collect();
    (0..COUNT).map(|_| ((0..bones).map(|_| noise.quaternion(1.6)).collect(), weights(&mut noise))).collect()
}

fn averages<T: Real>(c: &mut Criterion, precision: &str) {
    let mut group = c.benchmark_group(format!("average/{precision}"));
    group.throughput(Throughput::Elements(COUNT as u64));
    let power = Solver::Power { steps: 15, start: Start::Heaviest };
    for bones in [1, 2, 4] {
        let problems = problems::<T>(bones);
        for solver in [Solver::ClosedForm, Solver::Eigen, Solver::Polar, power, Solver::Nlerp] {
            group.bench_function(BenchmarkId::new(solver.to_string(), bones), |b| {
                b.iter(|| {
                    for (quats, weights) in &problems {
                        black_box(average_rotation(quats, weights, solver));
                    }
                });
            });
        }
    }
    let pairs = problems::<T>(2);
    group.bench_function("two_bones", |b| {
        b.iter(|| {
            for (quats, weights) in &pairs {
                black_box(two_bones(quats[0], weights[0], quats[1], weights[1]));
            }
        });
    });
}

/// Blends of `bones` rotations side by side in `N` lanes.
fn blends<const N: usize>(bones: usize) -> Vec<[[f32; N]; 9]> {
    let problems = problems::<f32>(bones);
    let blend = |chunk: &[(Vec<Quaternion<f32>>, Vec<f32>)]| {
        let mut blends = [[0.0; N]; 9];
        for (lane, (quats, weights)) in chunk.iter().enumerate() {
            let total: f32 = weights.iter().sum();
            for (&q, weight) in quats.iter().zip(weights) {
                for (k, entry) in quaternion_to_matrix_raw(q).into_iter().flatten().enumerate() {
                    blends[k][lane] += weight / total * entry;
                }
            }
        }
        blends
    };
    problems.chunks(N).map(blend).collect()
}

fn lane_kernel<const N: usize>(c: &mut Criterion) {
    let mut group = c.benchmark_group(format!("lanes/{N}"));
    group.throughput(Throughput::Elements(COUNT as u64));
    let blends = blends::<N>(4);
    group.bench_function("from_blends", |b| {
        b.iter(|| {
            for blend in &blends {
                black_box(lanes::from_blends(black_box(blend), &[1.0; N]));
            }
        });
    });
}

fn sh_rotation(c: &mut Criterion) {
    let mut noise = Noise(11);
    let quats: Vec<Quaternion<f32>> = (0..COUNT).map(|_| noise.quaternion(3.0)).collect();
    let mut sh: Vec<[f32; 3]> = (0..COUNT * 16).map(|_| [0, 1, 2].map(|_| noise.next() as f32)).collect();
    let mut group = c.benchmark_group("sh");
    group.throughput(Throughput::Elements(COUNT as u64));
    for degree in 1..=3 {
        group.bench_function(BenchmarkId::new("rotate", degree), |b| {
            b.iter(|| {
                for (coefficients, &q) in black_box(&mut sh).chunks_exact_mut(16).zip(&quats) {
                    sh::Rotation::from_unit_quaternion(q, degree).apply(coefficients);
                }
            });
        });
    }
}

fn all(c: &mut Criterion) {
    averages::<f32>(c, "f32");
    averages::<f64>(c, "f64");
    lane_kernel::<8>(c);
    lane_kernel::<16>(c);
    sh_rotation(c);
}

criterion_group! {
    name = math;
    config = Criterion::default()
        .warm_up_time(std::time::Duration::from_millis(100))
        .measurement_time(std::time::Duration::from_millis(300))
        .sample_size(20);
    targets = all
}
criterion_main!(math);
