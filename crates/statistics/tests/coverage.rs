//! How often intervals hold the truth, by simulation. `examples/coverage_tables.rs` prints the tables of the crate's page.

#[path = "support/simulation.rs"]
mod simulation;

use simulation::{Design, SEQUENCES};

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
