//! The tables of the crate's page: how often intervals hold the truth, and how wide they are, by simulation.
//!
//! `cargo run --release -p skinsplat-statistics --example coverage_tables`
#![expect(clippy::print_stdout, reason = "an example")]

#[path = "../tests/support/simulation.rs"]
mod simulation;

use simulation::{Design, SEQUENCES};
use skinsplat_core::math::portable::powi;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_statistics::estimate;

fn main() {
    println!("Percent of the intervals that hold the truth: by frames (rows) and autocorrelation, 0 to 0.9");
    coverage_by_frames();
    println!("\nMedian width in units of the interval that knows the dependence, of 8, 12, 20 and 40 frames");
    widths_by_autocorrelation();
    println!("\nBy the frames of several sequences and autocorrelation, 0 to 0.8");
    coverage_by_sequences();
    println!("\nOf three seeds, by their standard deviation and autocorrelation, 0 to 0.6");
    coverage_by_seeds();
}

/// Median width of an interval in units of the one that knows variance and autocorrelation.
fn median_width(n: usize, rho: f64) -> f64 {
    let covariances = (0..n).flat_map(|i| (0..n).map(move |j| i.abs_diff(j))).map(|k| powi(rho, k as i32));
    let known = 2.0 * 1.96 * covariances.sum::<f64>().sqrt() / n as f64;
    let width = |seed: u64| {
        let series = Design::of_frames(n, rho).draw(&mut SplitMix64::new(seed));
        estimate(&series, true)
            .expect("series of numbers")
            .interval
            .map(|interval| (interval.high - interval.low) / known)
    };
    let mut widths: Vec<f64> = (0..2001).filter_map(width).collect();
    widths.sort_by(f64::total_cmp);
    widths[widths.len() / 2]
}

fn show(found: Option<f64>) -> String {
    found.map_or("too few frames".to_owned(), |c| format!("{c:.1}"))
}

fn print_row(name: impl std::fmt::Display, cells: impl IntoIterator<Item = String>) {
    println!("| {name} | {} |", cells.into_iter().collect::<Vec<_>>().join(" | "));
}

fn coverage_by_frames() {
    for n in [6, 7, 8, 10, 12, 16, 20, 30, 40, 100] {
        let row = [0.0, 0.2, 0.4, 0.6, 0.8, 0.9];
        print_row(n, row.map(|rho| show(Design::of_frames(n, rho).coverage(5000))));
    }
}

fn widths_by_autocorrelation() {
    for rho in [0.0, 0.6] {
        print_row(rho, [8, 12, 20, 40].map(|n| format!("{:.1}", median_width(n, rho))));
    }
}

fn coverage_by_sequences() {
    for frames in SEQUENCES {
        let design = |rho| Design { frames: frames.to_vec(), ..Design::of_frames(0, rho) };
        print_row(format!("{frames:?}"), [0.0, 0.4, 0.6, 0.8].map(|rho| show(design(rho).coverage(5000))));
    }
}

fn coverage_by_seeds() {
    for seed_sd in [0.0, 0.1, 0.2, 0.5, 1.0, 5.0] {
        let between = [0.0, seed_sd, 0.3];
        let design = |rho| Design { seeds: 3, between, ..Design::of_frames(20, rho) };
        print_row(seed_sd, [0.0, 0.3, 0.6].map(|rho| show(design(rho).coverage(3000))));
    }
}
