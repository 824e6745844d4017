//! Kinds of capture.

use serde::{Deserialize, Serialize};

/// How a subject was captured, found by looking at the data. A stand-in must be of the kind that a table's own data set is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Capture {
    /// One camera, a moving subject (NeuMan, PeopleSnapshot).
    #[default]
    Monocular,
    /// Several calibrated cameras (GalaBasketball).
    Multiview,
    /// One camera and a rig with fingers: SMPL-X's 55 joints (X-Humans), or a synthetic figure with fingers.
    Hands,
}

impl Capture {
    /// The kind as a phrase for captions.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Monocular => "monocular capture",
            Self::Multiview => "multi-view capture",
            Self::Hands => "monocular capture on a rig with fingers",
        }
    }
}
