//! How much of the data a run looks at.

use serde::{Deserialize, Serialize};
use skinsplat_data::select::evenly_spaced;
use skinsplat_metrics::LpipsNet;

/// A bound on frames and resolution. It is part of every key that it influences and of every caption.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Id, printed in captions.
    pub id: String,
    /// Frames per training sequence from which an avatar is made, [`evenly_spaced`]; all if absent.
    pub max_train_frames: Option<usize>,
    /// Frames per test sequence that are scored, [`evenly_spaced`]; all if absent.
    pub max_test_frames: Option<usize>,
    /// Longer side of the scored images, pixels: larger frames are reduced to it; native if absent.
    pub resolution: Option<u32>,
    /// Most iterations of a fit, one training frame each; as many as the recipe says if absent.
    pub fit_iterations: Option<u32>,
    /// Edge length that avatars made from frames resolve, millimetres: about a pixel of the scored images.
    pub avatar_edge_mm: u32,
}

impl Profile {
    /// Ids of the presets.
    pub const IDS: [&str; 3] = ["quick", "standard", "paper"];

    /// A look in minutes: 12 training and 6 test frames per sequence, images of at most 256 pixels, short fits.
    pub fn quick() -> Self {
        Self {
            id: "quick".into(),
            max_train_frames: Some(12),
            max_test_frames: Some(6),
            resolution: Some(256),
            fit_iterations: Some(240),
            avatar_edge_mm: 20,
        }
    }

    /// Every frame at its native resolution, fitted in minutes each.
    pub fn standard() -> Self {
        Self {
            id: "standard".into(),
            max_train_frames: None,
            max_test_frames: None,
            resolution: None,
            fit_iterations: Some(2000),
            avatar_edge_mm: 10,
        }
    }

    /// Every frame at its native resolution, fitted for as many iterations as the compared method's own.
    pub fn paper() -> Self {
        Self { id: "paper".into(), fit_iterations: None, avatar_edge_mm: 7, ..Self::standard() }
    }

    /// The preset of this id.
    pub fn preset(id: &str) -> Option<Self> {
        match id {
            "quick" => Some(Self::quick()),
            "standard" => Some(Self::standard()),
            "paper" => Some(Self::paper()),
            _ => None,
        }
    }
}

/// A part of the frames, asked for by the user. A table of a subset is marked "partial".
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subset {
    /// Only test frames with `start <= index < end` within their sequence (before the profile thins them out).
    pub frames: Option<[usize; 2]>,
    /// At most this many test frames per sequence (after the profile has thinned them out): the first ones.
    pub limit: Option<usize>,
    /// Only these subjects; all if empty.
    pub subjects: Vec<String>,
    /// Only these variants; all if empty.
    pub variants: Vec<String>,
}

impl Subset {
    /// True if nothing is left out.
    pub fn is_everything(&self) -> bool {
        *self == Self::default()
    }

    /// The test frames of a sequence that are scored, in order: `chosen` (what the split leaves) cut by the subset and
    /// thinned by the profile.
    pub(super) fn select(&self, chosen: Vec<usize>, profile: &Profile) -> Vec<usize> {
        let [start, end] = self.frames.unwrap_or([0, usize::MAX]);
        let kept: Vec<usize> = chosen.into_iter().filter(|&i| start <= i && i < end).collect();
        let thinned = evenly_spaced(&kept, profile.max_test_frames);
        thinned.into_iter().take(self.limit.unwrap_or(usize::MAX)).collect()
    }
}

/// What a plan is asked for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// Bounds on frames and resolution.
    pub profile: Profile,
    /// A part of it.
    pub subset: Subset,
    /// Weights of LPIPS that did not come with the program.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lpips_weights: Option<GivenWeights>,
    /// Seeds with which every fit is repeated, where an experiment has none of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seeds: Vec<u64>,
}

/// Weights of an LPIPS network that were read from a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GivenWeights {
    /// The network.
    pub net: LpipsNet,
    /// SHA-256 of the file, in hexadecimal.
    pub digest: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subset_cuts_before_and_limits_after_thinning() {
        let subset = Subset { frames: Some([10, 20]), limit: Some(2), ..Subset::default() };
        let profile = Profile { max_test_frames: Some(5), ..Profile::standard() };
        assert_eq!(subset.select((0..40).collect(), &profile), [11, 13]);
        assert!(!subset.is_everything());
        assert!(Subset::default().is_everything());
    }
}
