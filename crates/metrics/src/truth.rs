//! What a render is held against.

use skinsplat_core::scene::{Image, Mask};

/// The ground truth of a frame.
#[derive(Clone, Copy, Debug)]
pub enum Truth<'a> {
    /// Straight (un-premultiplied) colours and their alpha: composited over the protocol's background, and alpha is the
    /// mask of the regions. With a captured background the colours are scored as they are.
    Straight {
        /// Colours.
        rgb: &'a Image,
        /// Alpha, and mask.
        alpha: &'a Mask,
    },
    /// A finished image, scored as it is, and a mask for the regions that need one.
    Composited {
        /// Colours.
        rgb: &'a Image,
        /// Mask.
        mask: Option<&'a Mask>,
    },
}

impl<'a> Truth<'a> {
    pub(crate) fn rgb(&self) -> &'a Image {
        match self {
            Self::Straight { rgb, .. } | Self::Composited { rgb, .. } => rgb,
        }
    }

    pub(crate) fn mask(&self) -> Option<&'a Mask> {
        match self {
            Self::Straight { alpha, .. } => Some(alpha),
            Self::Composited { mask, .. } => *mask,
        }
    }
}
