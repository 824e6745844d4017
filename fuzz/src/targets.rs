//! What is fuzzed: every reader, and what follows it. A target takes the bytes of one file; whatever they are, it returns in
//! time, within memory, and without a panic. Shared by cargo-fuzz (`fuzz/`) and by a test on the stable toolchain
//! (`tests/fuzz_corpus.rs`), which includes this file.

use skinsplat::datasets::Registry;
use skinsplat::experiment::Experiment;
use skinsplat::report::Results;
use skinsplat::run::foreign::{OnBody, on_body};
use skinsplat::run::plan_file::PlanFile;
use skinsplat::run::store;
use skinsplat_core::scene::{Pose, PosedBody, RestBody};
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::folder::Options;
use skinsplat_data::hdf5::Hdf5;
use skinsplat_data::pickle::Pickle;
use skinsplat_data::{Sequence, Subject, body, camera, depth, frames, npy, poses};
use skinsplat_fit::FitOptions;
use skinsplat_fit::recipe::Recipe;
use skinsplat_fit::train::{Checkpoint, Trainer, start};
use skinsplat_metrics::lpips::Network;
use skinsplat_posing::{BoundAvatar, Strategy, bake, pose};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A reader, and what follows it.
#[derive(Clone, Copy)]
pub struct Target {
    /// Name: of its corpus, too.
    pub name: &'static str,
    /// The name that the file has: some readers look at its end.
    pub file: &'static str,
    /// Reads the file.
    run: fn(&Path),
}

/// Every target.
pub const TARGETS: [Target; 16] = [
    Target { name: "avatar", file: "avatar.ply", run: avatar },
    Target { name: "body", file: "body.npz", run: body_and_clip },
    Target { name: "poses", file: "poses.npz", run: pose_track },
    Target { name: "pickle", file: "values.pkl", run: pickle },
    Target { name: "image", file: "image.png", run: image },
    Target { name: "npy", file: "image.npy", run: array },
    Target { name: "cameras", file: "cameras.json", run: cameras },
    Target { name: "transforms", file: "transforms.json", run: transforms },
    Target { name: "hdf5", file: "values.hdf5", run: hdf5 },
    Target { name: "depth", file: "depth.tiff", run: depth_map },
    Target { name: "registry", file: "datasets.toml", run: registry },
    Target { name: "experiment", file: "tinyexp.toml", run: experiment },
    Target { name: "results", file: "results.json", run: results },
    Target { name: "store", file: "frames.jsonl", run: records },
    Target { name: "plan", file: "plan.json", run: plan },
    Target { name: "safetensors", file: "weights.safetensors", run: weights },
];

/// Checkpoints of fits, which no file of the corpus can hold: a checkpoint is of the code that wrote it.
pub const CHECKPOINT: Target = Target { name: "checkpoint", file: "a.checkpoint", run: checkpoint };

impl Target {
    /// Runs the target on a file of these bytes in a folder.
    pub fn run(&self, folder: &Path, bytes: &[u8]) {
        let path = folder.join(self.file);
        if std::fs::write(&path, bytes).is_ok() {
            (self.run)(&path);
        }
    }
}

/// The small subject of the tests.
fn tiny() -> &'static Subject {
    static TINY: OnceLock<Subject> = OnceLock::new();
    TINY.get_or_init(|| {
        let folder = Path::new(super::ROOT).join("tests/data/small/tiny");
        Subject::load(&folder, &Options::default()).expect("the tests' subject is whole")
    })
}

fn rest() -> &'static RestBody {
    &tiny().test[0].body
}

/// Strategies that read different things of an avatar.
const STRATEGIES: [&str; 4] =
    ["quaternion-average", "dual-quaternion", "splattingavatar-original", "push-forward"];

fn avatar(path: &Path) {
    let Ok(loaded) = read_avatar(path) else { return };
    let Ok(OnBody { avatar, body, .. }) = on_body(loaded, rest()) else { return };
    let body = body.as_ref().unwrap_or_else(|| rest());
    let Ok(bound) = BoundAvatar::new(&avatar, body) else { return };
    for motion in tiny().test[0].poses.iter().take(2) {
        let Ok(posed) = PosedBody::new(body, motion) else { continue };
        for strategy in STRATEGIES {
            let strategy: Strategy = strategy.parse().expect("a preset");
            if let Ok(posed) = pose(&bound, &posed, &strategy) {
                bake(&posed.as_posed(), &avatar.gaussians);
            }
        }
    }
}

fn body_and_clip(path: &Path) {
    let Ok(model) = body::load(path) else { return };
    let track = poses::load_clip(path, None).ok();
    let betas = track.as_ref().map_or(&[][..], |track| &track.betas);
    let Ok((rest, _)) = body::shape(&model, betas, &[]) else { return };
    let mut motions = vec![Pose::rest(&rest.skeleton)];
    motions.extend(
        track
            .and_then(|track| track.poses(&rest.skeleton).ok())
            .iter()
            .flat_map(|p| p.iter().take(2))
            .cloned(),
    );
    for motion in &motions {
        let _ = PosedBody::new(&rest, motion);
    }
}

fn pose_track(path: &Path) {
    let Ok(track) = poses::load(path) else { return };
    track.notes_for(&rest().skeleton);
    let Ok(motions) = track.poses(&rest().skeleton) else { return };
    for motion in motions.iter().take(3) {
        let _ = PosedBody::new(rest(), motion);
    }
}

fn pickle(path: &Path) {
    let Ok(file) = Pickle::read(path, "values") else { return };
    for key in file.root().keys().unwrap_or_default() {
        if let Ok(field) = file.get(&key) {
            let _ = (field.array().is_ok(), field.rows().is_ok(), field.texts().is_ok());
        }
    }
}

fn image(path: &Path) {
    let _ = (frames::load_image(path), frames::load_mask(path), frames::stored_range(path));
}

fn array(path: &Path) {
    let _ = (npy::read(path), frames::load_image(path), frames::load_mask(path));
}

fn cameras(path: &Path) {
    let _ = (camera::load_views(path), camera::load(path));
}

/// Through the layout of folders: images and body are whole, what is said of them is not.
fn transforms(path: &Path) {
    let Some(folder) = path.parent().map(|folder| folder.join("subject")) else { return };
    if !folder.is_dir() {
        let whole = Path::new(super::ROOT).join("tests/data/small/tiny");
        for place in [
            "models/body.npz",
            "test_b/images/image_0000.png",
            "test_b/images/image_0001.png",
            "test_b/images/image_0002.png",
            "test_b/masks/mask_0000.png",
            "test_b/masks/mask_0001.png",
            "test_b/masks/mask_0002.png",
        ] {
            let to = folder.join(place);
            std::fs::create_dir_all(to.parent().expect("a file in a folder")).expect("a folder of our own");
            std::fs::copy(whole.join(place), to).expect("a file of the tests");
        }
    }
    std::fs::copy(path, folder.join("test_b/transforms.json")).expect("a folder of our own");
    let Ok(subject) = Subject::load(&folder, &Options::default()) else { return };
    for sequence in subject.sequences() {
        let _ =
            (sequence.digest(), sequence.poses.first().map(|motion| PosedBody::new(&sequence.body, motion)));
    }
}

fn hdf5(path: &Path) {
    let Ok(file) = Hdf5::open(path, "values") else { return };
    for name in ["masks", "pose", "trans", "betas"] {
        let Ok(rows) = file.rows(name) else { continue };
        for row in 0..rows.shape().first().copied().unwrap_or_default().min(3) {
            let _ = rows.row(row);
        }
        let _ = file.array(name, &[0, 0]);
    }
}

fn depth_map(path: &Path) {
    let _ = depth::load(path);
}

fn registry(path: &Path) {
    let _ = Registry::load(path);
}

fn experiment(path: &Path) {
    let Ok(experiment) = Experiment::load(path) else { return };
    let _ = experiment.with_all_strategies().with_seeds(&[0, 1, 2]);
}

fn results(path: &Path) {
    let Ok(text) = std::fs::read_to_string(path) else { return };
    let Ok(results) = Results::from_json(&text) else { return };
    let _ = (results.to_json(), skinsplat::report::page(&results));
    let tolerances = skinsplat::report::compare::Tolerances::default();
    let _ = skinsplat::report::compare::compare(&results, &results, &tolerances);
}

fn records(path: &Path) {
    let _ = (store::read(path), store::read_all(path));
}

fn plan(path: &Path) {
    let Ok(file) = PlanFile::read(path) else { return };
    let _ = skinsplat::experiment::Slices::of(&file.plan, 3);
}

fn weights(path: &Path) {
    let _ = std::fs::read(path).map(|bytes| Network::from_safetensors(&bytes));
}

/// The fit whose checkpoints are fuzzed.
fn fit() -> (Sequence, FitOptions) {
    let recipe = Recipe::parse("hugs-skinned").expect("a recipe");
    (tiny().train[0].clone(), FitOptions { recipe, iterations: 60, seed: 0, edge_mm: 200 })
}

/// A checkpoint as the files of fits hold it, without its checksum.
pub fn checkpoint_seed() -> Vec<u8> {
    let (sequence, options) = fit();
    let started = start(&sequence, &options).expect("the tests' subject can be fitted to");
    let mut trainer = Trainer::new(&sequence, &options, started.avatar).expect("an avatar of its body");
    while !trainer.is_resting() || trainer.is_done() {
        trainer.step().expect("a fit of sound data");
    }
    postcard::to_stdvec(&trainer.checkpoint().expect("a fit that rests")).expect("a checkpoint serialises")
}

fn checkpoint(path: &Path) {
    let Ok(bytes) = std::fs::read(path) else { return };
    let Ok(checkpoint) = postcard::from_bytes::<Checkpoint>(&bytes) else { return };
    static FIT: OnceLock<(Sequence, FitOptions)> = OnceLock::new();
    let (sequence, options) = FIT.get_or_init(fit);
    if let Ok(mut trainer) = Trainer::resume(sequence, options, checkpoint) {
        let _ = trainer.step();
    }
}

/// The files of a target's corpus, sorted.
pub fn corpus(target: &Target) -> Vec<PathBuf> {
    let folder = Path::new(super::ROOT).join("fuzz/corpus").join(target.name);
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    files
}
