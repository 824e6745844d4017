#![doc = include_str!("../README.md")]
//!
//! The dataset that needs no file: articulated subjects with exact skeletons, skinning weights, motions and true images,
//! made in-process from a few parameters, bit for bit the same for any number of threads.
//!
//! Two rigs ([`Rig`]): a human **figure** with SMPL's 24 joints (or 52 with fingers) and an **arm**, a tube of bones in a
//! row for studies of single joints. The surface is a closed, consistently oriented mesh of a smooth implicit shape; its
//! weights are smooth, at most four per vertex; texture coordinates cover it with charts. What it looks like is a function
//! of the position on the rest body (sharp patterns that punish a splat turned the wrong way) and of the light (glossy, so
//! that colours depend on the view); see [`Lights`] for what the lights are fixed to.
//!
//! The truth is the linearly blended mesh (Eq. 6), supersampled: a twist of 180 degrees between two bones of equal weight
//! collapses it to a point there (the candy wrapper), because that is what linear blend skinning does. No Gaussian, no
//! quaternion blending and no spherical harmonics are involved, except for `lights = "body"`.
//!
//! | capture | training | tests |
//! |---|---|---|
//! | monocular | `train`: a turn in front of the camera | `test_twist`, `test_bend` |
//! | multiview | `train`: a drill among cameras | `test_novel_view` (training poses, other cameras), `test_twist`, `test_bend` |
//! | hands | `train`: gestures of the upper body | `test_fingers` |
#![cfg_attr(test, expect(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

mod atlas;
mod cell;
mod field;
mod figure;
mod flesh;
mod lighting;
mod material;
mod motion;
mod noise;
mod parameters;
mod skeleton;
mod stage;
mod subject;
mod surface;
mod truth;
mod weights;

pub use parameters::{
    ArmShape, FigureShape, GENERATOR_VERSION, Lights, Look, Motion, Parameters, Pattern, Rig,
};
pub use subject::Subject;

use serde::Deserialize;
use skinsplat_core::scene::SceneError;
use std::collections::BTreeMap;

/// The subjects that come with the program, as TOML: what [`subjects`] reads.
pub const SUBJECTS: &str = include_str!("subjects.toml");

/// Parameters by subject name, from TOML tables `[name]`.
///
/// # Errors
/// Text that is not such TOML, or parameters out of range; the field is `name.rig.girth` or the like.
pub fn subjects(text: &str) -> Result<BTreeMap<String, Parameters>, SceneError> {
    let tables = toml::Deserializer::parse(text).and_then(BTreeMap::<String, Parameters>::deserialize);
    let tables = tables.map_err(|cause| {
        let problem = cause.to_string();
        SceneError::new(
            "subjects",
            problem.trim_end().replace('\n', " "),
            "a table of parameters per subject",
        )
    })?;
    for (name, parameters) in &tables {
        parameters.validate().map_err(|e| SceneError { field: format!("{name}.{}", e.field), ..e })?;
    }
    Ok(tables)
}
