//! Fitting end to end on the embedded subject, small: it helps on frames it has not seen, it is deterministic, it survives
//! an interruption, and it says what is wrong.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use skinsplat::datasets::Registry;
use skinsplat::run::held_out::held_out;
use skinsplat_core::scene::{Avatar, Binding, Camera, Image, Mask};
use skinsplat_data::{FrameGenerator, FrameRef, FrameSource, Sequence, Subject, Truth};
use skinsplat_fit::Error;
use skinsplat_fit::options::PoseFit;
use skinsplat_fit::pose_fit::{Posable, Target, fit_pose};
use skinsplat_fit::texture::{SAMPLES, TextureInit, gather_texture};
use skinsplat_fit::train::{Trainer, start};
use skinsplat_fit::{FitOptions, RECIPES, Recipe};
use skinsplat_render::mesh::SamplePattern;
use std::sync::Arc;

/// The embedded subject, its first frames, at 96 pixels.
fn subject() -> Subject {
    let registry = Registry::embedded();
    let dataset = registry.datasets.iter().find(|d| d.id == "snapshot_ava").unwrap();
    dataset.load(&Default::default()).unwrap().remove(0)
}

fn small(sequence: &Sequence, frames: usize) -> Sequence {
    let count = sequence.frames.len();
    let chosen: Vec<usize> = (0..frames).map(|i| i * count / frames).collect();
    sequence.selected(&chosen).unwrap().reduced(96)
}

fn options(recipe: &str, iterations: u32) -> FitOptions {
    FitOptions { recipe: Recipe::parse(recipe).unwrap(), iterations, seed: 3, edge_mm: 40 }
}

fn fitted(sequence: &Sequence, options: &FitOptions) -> Avatar {
    let mut trainer = Trainer::new(sequence, options, start(sequence, options).unwrap().avatar).unwrap();
    while !trainer.is_done() {
        trainer.step().unwrap();
    }
    trainer.avatar().clone()
}

/// Every recipe improves on its start, on poses that it has not seen, within a minute's worth of iterations.
#[test]
fn every_recipe_improves_on_its_start_on_held_out_poses() {
    let subject = subject();
    let (training, test) = (small(&subject.train[0], 6), [small(&subject.test[0], 4)]);
    for recipe in RECIPES.iter().filter(|recipe| recipe.id != "pure-skinned") {
        let options = options(&recipe.id, 60);
        let strategy = recipe.strategy.parse().unwrap();
        let first = start(&training, &options).unwrap().avatar;
        let mut trainer = Trainer::new(&training, &options, first.clone()).unwrap();
        let before = held_out(trainer.fitted(), &strategy, &test, 0, true).unwrap().remove(0);
        while !trainer.is_done() {
            trainer.step().unwrap();
        }
        let avatar = trainer.avatar();
        let after = held_out(trainer.fitted(), &strategy, &test, 60, true).unwrap().remove(0);
        assert!(after.psnr > before.psnr + 0.5, "{}: {} dB to {} dB", recipe.id, before.psnr, after.psnr);
        assert_eq!(avatar.gaussians.sh_degree, usize::from(recipe.sh_degree), "{}", recipe.id);
        let fixed = recipe.densify.is_none();
        assert!(!fixed || avatar.gaussians.len() == first.gaussians.len(), "{}", recipe.id);
        avatar.validate(Some(&training.body)).unwrap();
    }
}

#[test]
fn an_interrupted_fit_ends_in_the_same_bits_on_any_number_of_threads() {
    let training = small(&subject().train[0], 4);
    for recipe in ["hugs-original", "splattingavatar-skinned", "ihuman-original", "haha"] {
        let options = options(recipe, 56);
        let first = start(&training, &options).unwrap().avatar;
        let mut trainer = Trainer::new(&training, &options, first.clone()).unwrap();
        while !trainer.is_done() {
            trainer.step().unwrap();
        }
        let (whole, mesh) = (trainer.avatar().clone(), trainer.fitted().mesh.cloned());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let resumed = pool.install(|| {
            let mut trainer = Trainer::new(&training, &options, first.clone()).unwrap();
            for _ in 0..50 {
                trainer.step().unwrap();
            }
            assert!(trainer.is_resting());
            let bytes = postcard::to_stdvec(&trainer.checkpoint().unwrap()).unwrap();
            let checkpoint = postcard::from_bytes(&bytes).unwrap();
            let mut trainer = Trainer::resume(&training, &options, checkpoint).unwrap();
            while !trainer.is_done() {
                trainer.step().unwrap();
            }
            (trainer.avatar().clone(), trainer.fitted().mesh.cloned())
        });
        assert_eq!(mesh.is_some(), options.recipe.mesh.is_some());
        assert!((&whole, &mesh) == (&resumed.0, &resumed.1), "{recipe}");
        assert_ne!(whole, first);
    }
}

/// Most Gaussians are removed, and more of them where the truth is what the mesh can show.
#[test]
fn gaussians_of_a_hybrid_stay_where_the_mesh_falls_short() {
    let training = small(&subject().train[0], 3);
    let recipe = "haha+loss.opacity=0.01+start.inset=0.0+rates.position=1e-3+rates.scale=1e-2+schedule.and_shape_visits=false";
    let options = options(recipe, 150);
    let first = start(&training, &options).unwrap().avatar;
    let survivors = |sequence: &Sequence| {
        let mut trainer = Trainer::new(sequence, &options, first.clone()).unwrap();
        while !trainer.is_done() {
            trainer.step().unwrap();
        }
        trainer.avatar().gaussians.len()
    };
    let trainer = Trainer::new(&training, &options, first.clone()).unwrap();
    let mesh = trainer.fitted().mesh.unwrap();
    let shown_by_the_mesh = broken(&training, |i, truth| {
        let frame = &training.frames[i];
        let (pose, camera) = (&training.poses[frame.pose], &training.cameras[frame.camera]);
        let drawing = mesh.drawing(pose, camera, SamplePattern::new(SAMPLES)).unwrap();
        (truth.rgb, truth.alpha) = (drawing.colour, drawing.coverage);
    });
    let (few, more) = (survivors(&shown_by_the_mesh), survivors(&training));
    assert!(few < more && 2 * more < first.gaussians.len(), "{few}, {more} of {}", first.gaussians.len());
}

/// HAHA's stages: Gaussians alone, texels alone, both.
#[test]
fn a_hybrid_is_fitted_in_three_stages() {
    let training = small(&subject().train[0], 3);
    let options = options("haha+mesh.gaussians_first=0.25+mesh.texture_next=0.25+mesh.texture=64", 12);
    let first = start(&training, &options).unwrap().avatar;
    let mut trainer = Trainer::new(&training, &options, first).unwrap();
    let parts = |trainer: &Trainer<'_>| {
        (trainer.avatar().clone(), trainer.fitted().mesh.unwrap().texture.image().clone())
    };
    let mut before = parts(&trainer);
    for iteration in 0..12 {
        trainer.step().unwrap();
        let after = parts(&trainer);
        let changed = (before.0 != after.0, before.1 != after.1);
        let expected = match iteration {
            0..3 => (true, false),
            3..6 => (false, true),
            _ => (true, true),
        };
        assert_eq!(changed, expected, "iteration {iteration}");
        before = after;
    }
}

/// A mesh alone is brought back to the pose in which it was seen.
#[test]
fn the_pose_of_a_textured_mesh_is_found_again() {
    let training = small(&subject().train[0], 2);
    let init = TextureInit { size: 128, ..TextureInit::default() };
    let mesh = gather_texture(&training, &init).unwrap();
    let (pose, camera) = (&training.poses[training.frames[1].pose], &training.cameras[0]);
    let drawing = mesh.drawing(pose, camera, SamplePattern::new(SAMPLES)).unwrap();
    let truth = Truth::new(drawing.colour, drawing.coverage);
    let joint = |k: usize| glam::DVec3::new(0.0, 0.0, if k.is_multiple_of(2) { 0.05 } else { -0.05 });
    let turns: Vec<glam::DVec3> = (0..pose.locals.len()).map(joint).collect();
    let given = pose.turned(&turns, glam::DVec3::new(0.01, -0.01, 0.0));
    let posable = Posable { body: &training.body, gaussians: None, mesh: Some(&mesh) };
    let target = Target { truth: &truth, camera, background: [1.0; 3], antialiased: false };
    let found = fit_pose(&posable, &target, &given, &PoseFit::default()).unwrap();
    let [before, after] = found.losses;
    assert!(after < 0.25 * before, "{before} {after}");
}

#[test]
fn a_checkpoint_of_another_fit_is_refused() {
    let training = small(&subject().train[0], 2);
    let (mine, other) = (options("animatable-skinned", 10), options("animatable-skinned", 11));
    let trainer = Trainer::new(&training, &mine, start(&training, &mine).unwrap().avatar).unwrap();
    let refused = |sequence: &Sequence, options: &FitOptions| {
        let error = Trainer::resume(sequence, options, trainer.checkpoint().unwrap()).err().unwrap();
        assert!(error.to_string().contains("another fit"), "{error}");
    };
    refused(&training, &other);
    // The same names and sizes, other poses and images.
    let mut poses = training.poses.to_vec();
    poses[training.frames[0].pose].translation.x += 1e-3;
    refused(&Sequence { poses: poses.into(), ..training.clone() }, &mine);
    refused(&broken(&training, |_, truth| emptied(truth)), &mine);
    assert!(Trainer::resume(&training, &mine, trainer.checkpoint().unwrap()).is_ok());
}

#[test]
fn only_what_is_free_changes() {
    let training = small(&subject().train[0], 2);
    let fixed =
        "animatable-skinned+free.position=fixed+free.rotation=fixed+free.scale=fixed+free.opacity=false";
    let options = options(fixed, 5);
    let first = start(&training, &options).unwrap().avatar;
    let after = fitted(&training, &options);
    assert_eq!(first.gaussians.means, after.gaussians.means);
    assert_eq!(first.gaussians.rotations, after.gaussians.rotations);
    assert_eq!(first.gaussians.log_scales, after.gaussians.log_scales);
    assert_eq!(first.gaussians.opacity_logits, after.gaussians.opacity_logits);
    assert_ne!(first.gaussians.sh, after.gaussians.sh);

    let along = self::options("animatable-skinned+free.position=along-normal+free.rotation=about-normal", 5);
    let after = fitted(&training, &along);
    let normal = |avatar: &Avatar, i: usize| {
        let [w, x, y, z] = avatar.gaussians.unit_rotations()[i];
        glam::Quat::from_xyzw(x, y, z, w) * glam::Vec3::Z
    };
    for i in (0..first.gaussians.len()).step_by(37) {
        let (before, now) = (normal(&first, i), normal(&after, i));
        assert!(before.dot(now) > 1.0 - 1e-5, "the normal stays");
        let way = after.gaussians.means[i] - first.gaussians.means[i];
        assert!(way.cross(before).length() < 1e-6, "the way is along the normal");
    }
}

/// A bound on scales holds, and rates that fall move less.
#[test]
fn scales_are_bounded_and_rates_decay() {
    let subject = subject();
    let training = small(&subject.train[0], 3);
    let bounded = options("animatable-skinned+free.scale_most=1.05+rates.scale=0.1", 12);
    let start = start(&training, &bounded).unwrap().avatar;
    let growth = |options: &FitOptions| {
        let avatar = fitted(&training, options);
        let scales = avatar.gaussians.log_scales.iter().zip(&start.gaussians.log_scales);
        scales.map(|(now, first)| (*now - *first).max_element().exp()).fold(0.0, f32::max)
    };
    let free = options("animatable-skinned+free.scale_most=0.0+rates.scale=0.1", 12);
    assert!((1.04..1.051).contains(&growth(&bounded)) && growth(&free) > 1.5);
    let decayed = options("animatable-skinned+free.scale_most=0.0+rates.scale=0.1+rates.decay=0.000001", 12);
    assert!(growth(&decayed) < 0.7 * growth(&free), "{} {}", growth(&decayed), growth(&free));
}

#[test]
fn splitting_and_walking_change_the_number_and_keep_the_binding() {
    let training = small(&subject().train[0], 4);
    let recipe = "splattingavatar-skinned+densify.gradient=1e-7+densify.split_above=0.02+densify.most=1.5";
    let options = options(recipe, 30);
    let first = start(&training, &options).unwrap().avatar;
    let after = fitted(&training, &options);
    assert!(after.gaussians.len() > first.gaussians.len());
    assert!(after.gaussians.len() <= first.gaussians.len() * 3 / 2);
    let Binding::Face(binding) = &after.binding else { panic!("still bound to faces") };
    let inside = binding.barycentric.iter().filter(|b| b.iter().all(|&v| v > -0.5)).count();
    assert!(inside as f64 > 0.95 * after.gaussians.len() as f64, "those that slide out walk on");
}

/// Frames that a test breaks.
#[derive(Debug)]
struct Broken {
    truths: Vec<Truth>,
}

impl FrameGenerator for Broken {
    fn truth(&self, frame: usize) -> Result<Truth, skinsplat_data::Error> {
        Ok(self.truths[frame].clone())
    }

    fn key(&self) -> Result<String, skinsplat_data::Error> {
        Ok("broken".to_owned())
    }
}

/// The sequence with its truths changed.
fn broken(sequence: &Sequence, change: impl Fn(usize, &mut Truth)) -> Sequence {
    let mut truths: Vec<Truth> = (0..sequence.frames.len()).map(|i| sequence.truth(i).unwrap()).collect();
    truths.iter_mut().enumerate().for_each(|(i, truth)| change(i, truth));
    let generator = Arc::new(Broken { truths });
    let frames = sequence.frames.iter().enumerate().map(|(frame, old)| FrameRef {
        source: FrameSource::Generated { generator: generator.clone(), frame },
        ..old.clone()
    });
    Sequence { frames: frames.collect(), stored_sizes: None, ..sequence.clone() }
}

fn emptied(truth: &mut Truth) {
    truth.alpha = Mask::filled(truth.alpha.width(), truth.alpha.height(), 0.0);
}

#[test]
fn useless_frames_are_passed_over_with_a_warning_and_refused_if_there_is_no_other() {
    let training = small(&subject().train[0], 3);
    let options = options("animatable-skinned", 6);
    let first = start(&training, &options).unwrap().avatar;
    let one = broken(&training, |i, truth| {
        if i == 1 {
            emptied(truth);
        }
    });
    let mut trainer = Trainer::new(&one, &options, first.clone()).unwrap();
    while !trainer.is_done() {
        trainer.step().unwrap();
    }
    let warnings = trainer.take_warnings();
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("its mask is empty"), "{warnings:?}");

    let corner = broken(&training, |_, truth| {
        emptied(truth);
        truth.alpha.values_mut()[0] = 1.0;
    });
    let mut trainer = Trainer::new(&corner, &options, first.clone()).unwrap();
    let error = trainer.step().unwrap_err();
    assert!(error.to_string().contains("none of 3 can be used"), "{error}");
    assert!(trainer.take_warnings()[0].contains("misses the body"));

    let mut away = training.clone();
    let moved = |camera: &Camera| Camera { cx: camera.cx + 1e4, ..camera.clone() };
    away.cameras = away.cameras.iter().map(moved).collect::<Vec<_>>().into();
    let mut trainer = Trainer::new(&away, &options, first).unwrap();
    assert!(trainer.step().is_err());
    assert!(trainer.take_warnings()[0].contains("outside the image"));
}

#[test]
fn numbers_that_are_not_finite_stop_a_fit_by_name() {
    let training = small(&subject().train[0], 2);
    let options = options("animatable-skinned", 6);
    let first = start(&training, &options).unwrap().avatar;
    let nan = broken(&training, |_, truth| {
        let (width, height) = (truth.rgb.width(), truth.rgb.height());
        truth.rgb = Image::filled(width, height, [f32::NAN; 3]);
    });
    let mut trainer = Trainer::new(&nan, &options, first).unwrap();
    match trainer.step().unwrap_err() {
        Error::Diverged { iteration: 0, frame, parameter, .. } => {
            assert!(nan.frames.iter().any(|f| f.name == frame));
            assert!(parameter.contains("of Gaussian"), "{parameter}");
        }
        other => panic!("{other}"),
    }
}
