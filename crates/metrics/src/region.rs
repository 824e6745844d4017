//! Which pixels are scored.

use super::MetricsError;
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::Mask;
use std::ops::Range;

/// Which part of the images is scored. A pixel is inside the mask if its value reaches the protocol's threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Region {
    /// The whole image.
    #[default]
    Full,
    /// Both images cropped to the first to last row and column that the mask touches; what lies in the box outside the
    /// mask is compared too. SSIM pads at the borders of the crop.
    MaskBoundingBox,
    /// As `MaskBoundingBox`, but without the last row and column: HUGS uses the index of the last one as an exclusive
    /// bound.
    MaskBoundingBoxExclusive,
    /// Only the pixels inside the mask. SSIM is computed on the whole images and its map averaged over the mask (with
    /// `valid` SSIM: over the part of the mask that the map covers).
    Mask,
    /// Both images multiplied by the mask's values, then the whole image: the denominator stays the image.
    ImageTimesMask,
    /// Both images set to the protocol's background (black, if it has none) outside the mask, then the whole image.
    BackgroundOutsideMask,
}

impl Region {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Full,
        Self::MaskBoundingBox,
        Self::MaskBoundingBoxExclusive,
        Self::Mask,
        Self::ImageTimesMask,
        Self::BackgroundOutsideMask,
    ];

    /// Stable name, as in protocol files.
    pub fn id(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::MaskBoundingBox => "mask-bounding-box",
            Self::MaskBoundingBoxExclusive => "mask-bounding-box-exclusive",
            Self::Mask => "mask",
            Self::ImageTimesMask => "image-times-mask",
            Self::BackgroundOutsideMask => "background-outside-mask",
        }
    }

    /// Whether it needs a mask.
    pub fn needs_mask(self) -> bool {
        self != Self::Full
    }
}

/// Columns and rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Rect {
    pub(crate) x: Range<usize>,
    pub(crate) y: Range<usize>,
}

impl Rect {
    /// The values of a plane of this width that lie inside.
    pub(crate) fn cut<T: Copy>(&self, plane: &[T], width: usize) -> Vec<T> {
        let row = |y: usize| &plane[y * width + self.x.start..y * width + self.x.end];
        self.y.clone().flat_map(row).copied().collect()
    }
}

/// From the first to the last row and column that hold a mask value of `threshold` or more. `None` if no pixel does or
/// if leaving out the last row and column (`exclusive`) leaves nothing.
pub(crate) fn bounding_box(mask: &Mask, threshold: f32, exclusive: bool) -> Option<Rect> {
    let (mut left, mut right) = (usize::MAX, 0);
    let (mut top, mut bottom) = (usize::MAX, 0);
    for (y, row) in mask.values().chunks_exact(mask.width()).enumerate() {
        let Some(first) = row.iter().position(|&v| v >= threshold) else { continue };
        let last = row.iter().rposition(|&v| v >= threshold).unwrap_or(first);
        (left, right) = (left.min(first), right.max(last));
        (top, bottom) = (top.min(y), y);
    }
    let beyond = usize::from(!exclusive);
    let rect = Rect { x: left..right + beyond, y: top..bottom + beyond };
    (rect.x.start < rect.x.end && rect.y.start < rect.y.end).then_some(rect)
}

/// The error of a mask without a pixel inside.
pub(crate) fn empty(mask: &Mask, threshold: f32, region: Region) -> MetricsError {
    let largest = mask.values().iter().fold(0.0_f32, |largest, &v| largest.max(v));
    MetricsError::EmptyRegion { region: region.id(), threshold, largest }
}

/// The mask as weights: 1 inside, 0 outside. An error if nothing is inside.
pub(crate) fn inside(mask: &Mask, threshold: f32, region: Region) -> Result<Vec<f64>, MetricsError> {
    let weights: Vec<f64> = mask.values().iter().map(|&v| f64::from(u8::from(v >= threshold))).collect();
    if weights.contains(&1.0) {
        return Ok(weights);
    }
    Err(empty(mask, threshold, region))
}
