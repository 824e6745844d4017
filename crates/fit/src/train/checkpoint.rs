//! The state of a fit between two iterations.

use super::density::Density;
use super::layer::State;
use super::parameters::Parameters;
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
}

impl Checkpoint {
    pub(super) fn new(
        sequence: &Sequence,
        options: &FitOptions,
        parameters: Parameters,
        density: Density,
        layer: Option<State>,
        iteration: u32,
    ) -> Self {
        Self { key: key(sequence, options), iteration, parameters, density, layer }
    }

    /// Iterations done.
    pub fn iteration(&self) -> u32 {
        self.iteration
    }

    /// The checkpoint itself, if it belongs to this fit.
    pub(super) fn matching(self, sequence: &Sequence, options: &FitOptions) -> Result<Self, Error> {
        if self.key == key(sequence, options) {
            return Ok(self);
        }
        let expected = "one of the same frames, recipe, iterations, seed and program version";
        Err(Error::invalid("checkpoint", "it belongs to another fit", expected))
    }
}

/// What a checkpoint must agree with.
fn key(sequence: &Sequence, options: &FitOptions) -> String {
    let frames: Vec<&str> = sequence.frames.iter().map(|frame| frame.name.as_str()).collect();
    let sizes: Vec<[u32; 2]> = sequence.cameras.iter().map(|camera| [camera.width, camera.height]).collect();
    let code = [crate::CODE_VERSION, skinsplat_posing::CODE_VERSION, skinsplat_render::CODE_VERSION];
    content_key(&serde_json::json!({
        "code": code, "options": options, "sequence": sequence.id, "frames": frames, "sizes": sizes,
    }))
}
