//! The state of a fit between two iterations.

use super::density::Density;
use super::layer::State;
use super::parameters::Parameters;
use super::poses::TrainingPoses;
use crate::Error;
use crate::recipe::FitOptions;
use serde::{Deserialize, Serialize};
use skinsplat_data::key::content_key;
use skinsplat_data::sequence::Sequence;

/// The state of a fit between two iterations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Of the options, the code and the training data.
    key: String,
    pub(super) iteration: u32,
    pub(super) parameters: Parameters,
    pub(super) density: Density,
    /// Of the mesh that is drawn with the Gaussians.
    pub(super) layer: Option<State>,
    /// Of the poses, where they are fitted.
    pub(super) poses: Option<TrainingPoses>,
}

impl Checkpoint {
    /// The state of the fit with this [`key`].
    pub(super) fn new(
        key: String,
        parameters: Parameters,
        density: Density,
        layer: Option<State>,
        poses: Option<TrainingPoses>,
        iteration: u32,
    ) -> Self {
        Self { key, iteration, parameters, density, layer, poses }
    }

    /// Iterations done.
    pub fn iteration(&self) -> u32 {
        self.iteration
    }

    /// The checkpoint itself, if it belongs to the fit with this [`key`].
    pub(super) fn matching(self, key: &str) -> Result<Self, Error> {
        if self.key == key {
            return Ok(self);
        }
        let expected = "one of the same training data, recipe, iterations, seed and program version";
        Err(Error::Checkpoint { problem: format!("it belongs to another fit; expected {expected}") })
    }
}

/// What a checkpoint must agree with: options, code, and the training data by their content. Reads every training image.
pub(super) fn key(sequence: &Sequence, options: &FitOptions) -> Result<String, Error> {
    let frames: Vec<&str> = sequence.frames.iter().map(|frame| frame.name.as_str()).collect();
    let code = [crate::CODE_VERSION, skinsplat_posing::CODE_VERSION, skinsplat_render::CODE_VERSION];
    Ok(content_key(&serde_json::json!({
        "code": code, "options": options, "sequence": sequence.id, "frames": frames, "data": sequence.digest()?,
    })))
}
