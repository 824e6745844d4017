//! Which poses an experiment trains and scores on: noise, takes, and whether those of test images are fitted first.

use super::{AvatarRecipe, Column, Error, Experiment, Variant};
use serde::{Deserialize, Serialize};
use skinsplat_data::pose_noise;
use skinsplat_fit::options::PoseFit;

/// The most noise that makes sense, degrees.
const MOST_NOISE: f64 = 90.0;

/// What becomes of the poses of test images before they are scored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TestPoses {
    /// Nothing.
    #[default]
    AsGiven,
    /// Each is also fitted to its image with the avatar frozen; a table then shows both scores, side by side.
    Fitted,
}

impl TestPoses {
    /// True for [`TestPoses::AsGiven`].
    pub(super) fn are_given(&self) -> bool {
        *self == Self::AsGiven
    }
}

/// Noise on the poses of a variant, for training and for test, and the seed of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseNoise {
    /// Root of the mean square of the angle, per joint, degrees.
    pub degrees: f64,
    /// What it is drawn from.
    pub seed: u64,
    /// Version of how it is drawn.
    pub version: u32,
}

impl Experiment {
    /// The noise on the poses of a variant; none if there is none.
    pub fn noise_of(&self, variant: &Variant) -> Option<PoseNoise> {
        let degrees = variant.pose_noise.or(self.pose_noise).filter(|degrees| *degrees > 0.0)?;
        Some(PoseNoise { degrees, seed: self.pose_noise_seed, version: pose_noise::VERSION })
    }

    /// How poses of test images are fitted; none if they are not.
    pub fn fitted_test_poses(&self) -> Option<&PoseFit> {
        (self.test_poses == TestPoses::Fitted).then_some(&self.test_pose)
    }
}

/// That no column of fitted poses is there without the one as given, nor where nothing was fitted.
fn check_columns(e: &Experiment, file: &str) -> Result<(), Error> {
    let alone = |column: &&Column| {
        let given = e.columns.iter().any(|other| other.metric == column.metric && !other.fitted);
        column.fitted && (e.test_poses == TestPoses::AsGiven || !given)
    };
    if let Some(column) = e.columns.iter().find(|column| column.fitted && column.metric.needs_before()) {
        let problem = format!("`fitted` of {}", column.metric.id());
        let expected =
            "it as given only: each pose is fitted to its own image, so there is no fitted frame before it";
        return Err(Error::invalid(file, "columns", problem, expected));
    }
    match e.columns.iter().find(alone) {
        None => Ok(()),
        Some(column) => {
            let problem = format!("`fitted` of {}", column.metric.id());
            let expected = "test_poses = \"fitted\", which shows both scores of every metric";
            Err(Error::invalid(file, "columns", problem, expected))
        }
    }
}

/// Checks noise, takes, how poses are fitted, and the columns that show it.
pub(super) fn check(e: &Experiment, file: &str) -> Result<(), Error> {
    let noise = |key: String, degrees: Option<f64>| match degrees {
        Some(degrees) if !(0.0..=MOST_NOISE).contains(&degrees) => {
            Err(Error::invalid(file, key, degrees.to_string(), format!("degrees, 0 to {MOST_NOISE}")))
        }
        _ => Ok(()),
    };
    check_columns(e, file)?;
    noise("pose_noise".to_owned(), e.pose_noise)?;
    for (i, variant) in e.variants.iter().enumerate() {
        noise(format!("variants[{i}].pose_noise"), variant.pose_noise)?;
        if variant.takes == Some(0) {
            return Err(Error::invalid(
                file,
                format!("variants[{i}].takes"),
                "0",
                "at least 1 training sequence",
            ));
        }
        let without = matches!(variant.avatar, AvatarRecipe::Renders { .. });
        if without && (variant.pose_noise.is_some() || variant.takes.is_some()) {
            let key = format!("variants[{i}].pose_noise, takes");
            return Err(Error::invalid(file, key, "given", "none: renders of another program have no poses"));
        }
    }
    e.test_pose
        .check("test_pose")
        .map_err(|error| Error::invalid(file, "test_pose", error.to_string(), "numbers in range"))?;
    if e.test_poses == TestPoses::AsGiven && e.test_pose != PoseFit::default() {
        let expected = "test_poses = \"fitted\" beside it: no test pose is fitted otherwise";
        return Err(Error::invalid(file, "test_pose", "given, and of no effect", expected));
    }
    if e.pose_noise_seed != 0 && e.variants.iter().all(|variant| e.noise_of(variant).is_none()) {
        let expected = "pose_noise, of the experiment or of a variant: there is none to draw otherwise";
        return Err(Error::invalid(file, "pose_noise_seed", "given, and of no effect", expected));
    }
    Ok(())
}

/// Where test poses are fitted, every column of a metric of frames becomes two: as given, then fitted; metrics of motion, which see
/// the frame before, are of poses as given. An experiment that was written after that stays as it is.
pub(super) fn expand(mut e: Experiment) -> Experiment {
    if e.test_poses == TestPoses::AsGiven || e.columns.iter().any(|column| column.fitted) {
        return e;
    }
    let both = |column: Column| {
        if !column.metric.is_of_frames() {
            return vec![column];
        }
        let titled = |what: &str, fitted: bool| Column {
            title: Some(format!("{} ({what})", column.title())),
            fitted,
            ..column.clone()
        };
        let given = titled("as given", false);
        if column.metric.needs_before() { vec![given] } else { vec![given, titled("fitted", true)] }
    };
    e.columns = e.columns.into_iter().flat_map(both).collect();
    e
}
