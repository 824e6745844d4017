//! What a job leaves behind: one record per frame and variant.

use serde::{Deserialize, Serialize};
use skinsplat_metrics::FrameScore;
use std::collections::BTreeMap;

/// The score of one frame, rendered in one way, or why there is none.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameRecord {
    /// The content key of the [`super::JobVariant`].
    pub key: String,
    /// What the frame is, for people who read the store: data set, subject, sequence, frame name, variant.
    pub label: String,
    /// Score or failure.
    pub outcome: Outcome,
    /// Seconds that it took. No result depends on them, and neither does equality.
    #[serde(default)]
    pub seconds: Seconds,
    /// The widest angle between two joints that move one place of the body in the frame's pose, degrees, for charts; none where
    /// nothing bends, and in records of earlier programs. No result depends on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend: Option<f64>,
    /// Bytes of the avatar's files, where they are known. No result depends on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bytes: Option<u64>,
}

impl PartialEq for FrameRecord {
    /// Equal results: neither labels nor times nor what else is beside the result count.
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key && self.outcome == other.outcome
    }
}

/// Score or failure of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(clippy::large_enum_variant, reason = "scored is the usual one")]
pub enum Outcome {
    /// Rendered and scored.
    Scored {
        /// The metrics, in the protocol's variants.
        score: FrameScore,
        /// Gaussians that reach the image; none for a textured mesh.
        visible_splats: Option<u64>,
        /// The same after the pose was fitted to the image, where that was asked for.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        fitted: Option<FittedOutcome>,
    },
    /// Failed: the error, one line. The next run tries again.
    Error(String),
}

/// What came of a frame whose pose was fitted to its image, the avatar frozen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FittedOutcome {
    /// Fitted and scored.
    Scored {
        /// The metrics.
        score: FrameScore,
        /// By how much the joint that turned most has turned from the given pose, degrees.
        turned_degrees: f64,
    },
    /// It could not be fitted: why, one line. The score as given stands.
    Failed(String),
}

/// Seconds spent on a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seconds {
    /// Posing the avatar.
    pub pose: f64,
    /// Rendering.
    pub render: f64,
    /// Scoring.
    pub score: f64,
    /// Fitting the pose to the image, and the score after that, where it was asked for.
    #[serde(default, skip_serializing_if = "nothing")]
    pub fit: f64,
}

fn nothing(seconds: &f64) -> bool {
    *seconds == 0.0
}

/// Records by key: what a run or a report knows.
pub type Records = BTreeMap<String, FrameRecord>;
