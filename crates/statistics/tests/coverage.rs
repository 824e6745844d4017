//! How often intervals hold the truth, by simulation. `cargo test --release --workspace --test coverage -- --ignored --nocapture`
//! prints the tables of the crate's page.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use skinsplat_core::math::portable::{cos, ln, powi};
use skinsplat_core::math::random::SplitMix64;
use skinsplat_statistics::{Interval, Series, estimate};

/// A number of the standard normal distribution (Box and Muller 1958).
fn normal(random: &mut SplitMix64) -> f64 {
    let mut unit = || ((random.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    (-2.0 * ln(unit())).sqrt() * cos(2.0 * std::f64::consts::PI * unit())
}

/// A stationary first-order autoregression of mean 0 and variance 1.
fn autoregression(random: &mut SplitMix64, n: usize, rho: f64) -> Vec<f64> {
    let fresh = (1.0 - rho * rho).sqrt();
    let mut value = normal(random);
    let step = |i: usize| {
        if i > 0 {
            value = rho * value + fresh * normal(random);
        }
        value
    };
    (0..n).map(step).collect()
}

/// What is simulated: the truth is 0.
#[derive(Clone)]
struct Design {
    subjects: usize,
    seeds: usize,
    /// Frames of each sequence.
    frames: Vec<usize>,
    rho: f64,
    /// Standard deviations between subjects, between seeds, and of frames of one seed beside those that all share.
    between: [f64; 3],
}

impl Design {
    fn of_frames(n: usize, rho: f64) -> Self {
        Self { subjects: 1, seeds: 1, frames: vec![n], rho, between: [0.0; 3] }
    }

    fn draw(&self, random: &mut SplitMix64) -> Vec<Series> {
        let [subject_sd, seed_sd, own_sd] = self.between;
        let mut all = Vec::new();
        for subject in 0..self.subjects {
            let of_subject = subject_sd * normal(random);
            let of_seeds: Vec<f64> = (0..self.seeds).map(|_| seed_sd * normal(random)).collect();
            for (s, &n) in self.frames.iter().enumerate() {
                let shared = autoregression(random, n, self.rho);
                for (seed, of_seed) in of_seeds.iter().enumerate() {
                    let own = autoregression(random, n, self.rho);
                    let value =
                        |(a, b): (&f64, &f64)| (1.0 + s as f64) * (a + own_sd * b) + of_subject + of_seed;
                    all.push(Series {
                        subject: subject.to_string(),
                        seed: seed as u64,
                        sequence: s.to_string(),
                        values: shared.iter().zip(&own).map(value).collect(),
                    });
                }
            }
        }
        all
    }

    /// Percent of the given intervals that hold 0; none if none was given.
    fn coverage(&self, repetitions: u64) -> Option<f64> {
        let interval = |seed: u64| -> Option<Interval> {
            estimate(&self.draw(&mut SplitMix64::new(seed.wrapping_mul(0x9E37_79B9) + 11)), true)
                .unwrap()
                .interval
        };
        let given: Vec<Interval> = (0..repetitions).filter_map(interval).collect();
        let holding = given.iter().filter(|interval| interval.low <= 0.0 && 0.0 <= interval.high).count();
        (!given.is_empty()).then(|| 100.0 * holding as f64 / given.len() as f64)
    }
}

/// Median width of an interval in units of the one that knows variance and autocorrelation.
fn median_width(n: usize, rho: f64) -> f64 {
    let covariances = (0..n).flat_map(|i| (0..n).map(move |j| i.abs_diff(j))).map(|k| powi(rho, k as i32));
    let known = 2.0 * 1.96 * covariances.sum::<f64>().sqrt() / n as f64;
    let width = |seed: u64| {
        let series = Design::of_frames(n, rho).draw(&mut SplitMix64::new(seed));
        estimate(&series, true).unwrap().interval.map(|interval| (interval.high - interval.low) / known)
    };
    let mut widths: Vec<f64> = (0..2001).filter_map(width).collect();
    widths.sort_by(f64::total_cmp);
    widths[widths.len() / 2]
}

const SEQUENCES: [&[usize]; 4] = [&[5, 5], &[5, 5, 5], &[10, 30], &[20, 20]];

fn assert_covers(name: &str, found: Option<f64>) {
    let found = found.unwrap_or_else(|| panic!("{name}: no interval"));
    assert!((92.0..=98.0).contains(&found), "{name}: {found} %");
}

#[test]
fn intervals_of_frames_cover_whatever_the_autocorrelation() {
    for n in [6, 7, 8, 12, 20, 40] {
        for rho in [0.0, 0.4, 0.8] {
            let found = Design::of_frames(n, rho).coverage(800);
            if n < 8 {
                assert_eq!(found, None, "too few frames");
            } else {
                assert_covers(&format!("n = {n}, rho = {rho}"), found);
            }
        }
    }
}

/// The second sequence varies twice, the third three times as much as the first.
#[test]
fn intervals_of_several_sequences_cover() {
    for frames in SEQUENCES.map(<[usize]>::to_vec).into_iter().take(3) {
        for rho in [0.0, 0.6] {
            let design = Design { frames: frames.clone(), ..Design::of_frames(0, rho) };
            assert_covers(&format!("{frames:?}, rho = {rho}"), design.coverage(1000));
        }
    }
}

#[test]
fn intervals_of_subjects_cover() {
    for subjects in [2, 3, 4] {
        for seeds in [1, 2, 3] {
            for (rho, between) in [(0.0, [0.0, 0.0, 0.3]), (0.8, [0.3, 0.1, 0.3]), (0.5, [1.0, 0.5, 0.0])] {
                let frames = vec![6 + 2 * subjects];
                let design = Design { subjects, seeds, between, frames, ..Design::of_frames(0, rho) };
                assert_covers(
                    &format!("{subjects} subjects, {seeds} seeds, {between:?}"),
                    design.coverage(600),
                );
            }
        }
    }
}

/// Two variances of unknown ratio, one on two degrees of freedom: no interval is exact, this one rather too wide.
#[test]
fn intervals_of_seeds_cover_at_least() {
    for seed_sd in [0.0, 0.2, 5.0] {
        for rho in [0.0, 0.6] {
            let between = [0.0, seed_sd, 0.3];
            let design = Design { seeds: 3, between, ..Design::of_frames(20, rho) };
            let found = design.coverage(400).unwrap();
            assert!((92.0..=99.5).contains(&found), "seeds {seed_sd}, rho = {rho}: {found} %");
        }
    }
}

fn show(found: Option<f64>) -> String {
    found.map_or("too few frames".to_owned(), |c| format!("{c:.1}"))
}

fn print_row(name: impl std::fmt::Display, cells: impl IntoIterator<Item = String>) {
    println!("| {name} | {} |", cells.into_iter().collect::<Vec<_>>().join(" | "));
}

#[test]
#[ignore = "prints a table of the crate's page"]
fn print_coverage_by_frames() {
    for n in [6, 7, 8, 10, 12, 16, 20, 30, 40, 100] {
        let row = [0.0, 0.2, 0.4, 0.6, 0.8, 0.9];
        print_row(n, row.map(|rho| show(Design::of_frames(n, rho).coverage(5000))));
    }
}

#[test]
#[ignore = "prints what the crate's page says of widths"]
fn print_widths_by_autocorrelation() {
    for rho in [0.0, 0.6] {
        print_row(rho, [8, 12, 20, 40].map(|n| format!("{:.1}", median_width(n, rho))));
    }
}

#[test]
#[ignore = "prints a table of the crate's page"]
fn print_coverage_by_sequences() {
    for frames in SEQUENCES {
        let design = |rho| Design { frames: frames.to_vec(), ..Design::of_frames(0, rho) };
        print_row(format!("{frames:?}"), [0.0, 0.4, 0.6, 0.8].map(|rho| show(design(rho).coverage(5000))));
    }
}

#[test]
#[ignore = "prints a table of the crate's page"]
fn print_coverage_by_seeds() {
    for seed_sd in [0.0, 0.1, 0.2, 0.5, 1.0, 5.0] {
        let between = [0.0, seed_sd, 0.3];
        let design = |rho| Design { seeds: 3, between, ..Design::of_frames(20, rho) };
        print_row(seed_sd, [0.0, 0.3, 0.6].map(|rho| show(design(rho).coverage(3000))));
    }
}
