//! What refining poses is worth on a synthetic figure whose exact poses are known:
//! `cargo run --release -p skinsplat-fit --example refine_poses -- [DEGREES] [ITERATIONS] [RECIPE]`.

use skinsplat_core::math::portable;
use skinsplat_core::scene::{Pose, PosedBody};
use skinsplat_data::Sequence;
use skinsplat_fit::options::PoseFit;
use skinsplat_fit::pose_fit::{Posable, Target, fit_pose};
use skinsplat_fit::train::{self, Trainer};
use skinsplat_fit::{FitOptions, Recipe};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy};
use skinsplat_render::View;
use skinsplat_render::splat::Renderer;
use skinsplat_synthetic::{Parameters, Subject};
use std::time::Instant;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |default: &str| arguments.next().unwrap_or_else(|| default.to_owned());
    let (degrees, iterations, recipe): (f64, u32, String) =
        (next("5").parse()?, next("400").parse()?, next("animatable-skinned"));
    let parameters =
        Parameters { resolution: 256, train_frames: 24, test_frames: 8, ..Parameters::default() };
    let subject = Subject::new(&parameters)?;
    let (exact, tests) = (subject.train().remove(0), subject.test().remove(0));
    let (training, noisy_tests) = (exact.with_pose_noise(degrees, 0), tests.with_pose_noise(degrees, 0));
    for refine in ["", "+poses=refine"] {
        let options = FitOptions {
            recipe: Recipe::parse(&format!("{recipe}{refine}"))?,
            iterations,
            seed: 0,
            edge_mm: 14,
        };
        let mut trainer = Trainer::new(&training, &options, train::start(&training, &options)?.avatar)?;
        let clock = Instant::now();
        while !trainer.is_done() {
            trainer.step()?;
        }
        let step = clock.elapsed().as_secs_f64() * 1e3 / f64::from(iterations);
        let strategy: Strategy = options.recipe.strategy.parse()?;
        let bound = BoundAvatar::new(trainer.avatar(), &exact.body)?;
        let refined = trainer.poses().map(|poses| poses.into_iter().map(|own| own.pose).collect::<Vec<_>>());
        let (before, after) =
            (error(&training.poses, &exact), error(refined.as_deref().unwrap_or(&training.poses), &exact));
        let [given, fitted, found] = scores(&bound, &strategy, &noisy_tests, &tests)?;
        let [exact_poses, ..] = scores(&bound, &strategy, &tests, &tests)?;
        report(&format!(
            "{recipe}{refine}: {step:.1} ms a step; joints off by {before:.2} degrees, then {after:.2}; test frames {given:.2} dB as given, \
             {fitted:.2} fitted (joints then off by {found:.2}), {exact_poses:.2} at the exact poses"
        ));
    }
    Ok(())
}

/// Mean PSNR on test frames, as given and fitted, and the mean error of the fitted joints, degrees.
fn scores(
    bound: &BoundAvatar,
    strategy: &Strategy,
    tests: &Sequence,
    exact: &Sequence,
) -> Result<[f64; 3], Failure> {
    let (mut sums, mut poses) = ([0.0; 2], exact.poses.to_vec());
    for (i, frame) in tests.frames.iter().enumerate() {
        let (truth, camera, given) =
            (tests.truth(i)?, &tests.cameras[frame.camera], &tests.poses[frame.pose]);
        let psnr = |pose: &Pose| -> Result<f64, Failure> {
            let body = PosedBody::new(&tests.body, pose)?;
            let (mut poser, mut renderer) = (Poser::new(), Renderer::new());
            let posed = poser.pose(bound, &body, strategy, &PoseOptions::default())?;
            let image = &renderer.render(&posed, &View::new(camera).over([1.0; 3]))?.image;
            let over = truth.rgb.composited(&truth.alpha, [1.0; 3])?;
            let pairs = image.pixels().as_flattened().iter().zip(over.pixels().as_flattened());
            let squares = pairs.map(|(a, b)| f64::from((a.min(1.0) - b) * (a.min(1.0) - b))).sum::<f64>();
            Ok(-10.0 * portable::log10(squares / (3 * image.pixels().len()) as f64))
        };
        let posable = Posable { body: &tests.body, gaussians: Some((bound, strategy)), mesh: None };
        let target = Target { truth: &truth, camera, background: [1.0; 3], antialiased: false };
        let fitted = fit_pose(&posable, &target, given, &PoseFit::default())?.pose;
        sums[0] += psnr(given)?;
        sums[1] += psnr(&fitted)?;
        poses[frame.pose] = fitted;
    }
    let n = tests.frames.len() as f64;
    Ok([sums[0] / n, sums[1] / n, error(&poses, exact)])
}

/// Mean over poses and joints of the angle to the exact rotation, degrees.
fn error(poses: &[Pose], exact: &Sequence) -> f64 {
    let pairs = poses.iter().zip(exact.poses.iter()).flat_map(|(a, b)| a.locals.iter().zip(&b.locals));
    let angles: Vec<f64> =
        pairs.map(|(a, b)| portable::angle_between(a.rotation, b.rotation).to_degrees()).collect();
    angles.iter().sum::<f64>() / angles.len() as f64
}

#[expect(clippy::print_stdout, reason = "an example")]
fn report(line: &str) {
    println!("{line}");
}
