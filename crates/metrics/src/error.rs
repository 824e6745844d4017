//! What can be wrong with the input of a metric.

/// Why a metric, or a protocol, refuses its input. Sizes are width x height in pixels.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetricsError {
    /// Two images, or an image and its mask, differ in size.
    #[error(
        "{field}: {found_width}x{found_height} pixels; expected {width}x{height}, the size of the render"
    )]
    SizeMismatch {
        /// "truth", "alpha" or "mask".
        field: &'static str,
        /// Its width.
        found_width: usize,
        /// Its height.
        found_height: usize,
        /// Width of the render.
        width: usize,
        /// Height of the render.
        height: usize,
    },
    /// A NaN or an infinity.
    #[error("{field}: {value} in channel {channel} at x {x}, y {y}; expected a finite value")]
    NotFinite {
        /// "render", "truth", "alpha" or "mask".
        field: &'static str,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// 0 to 2; 0 for a mask.
        channel: usize,
        /// The value.
        value: f32,
    },
    /// The image (after cropping) cannot hold the window or its padding.
    #[error("{metric}: the scored image has {width}x{height} pixels; expected at least {minimum}x{minimum}")]
    TooSmall {
        /// Which variant refuses.
        metric: &'static str,
        /// Width after cropping.
        width: usize,
        /// Height after cropping.
        height: usize,
        /// Smallest width and height that the variant accepts.
        minimum: usize,
    },
    /// Weights of LPIPS that are not what they should be.
    #[error("{field}: {problem}; expected {expected}")]
    Weights {
        /// The file as a whole, or a tensor.
        field: String,
        /// What is wrong.
        problem: String,
        /// What was expected.
        expected: String,
    },
    /// A region needs a mask and none was given.
    #[error("mask: none given; expected one, for region \"{region}\"")]
    NoMask {
        /// The region.
        region: &'static str,
    },
    /// The region holds no pixel.
    #[error("mask: region \"{region}\" holds no pixel; expected at least one value of {threshold} or more")]
    EmptyRegion {
        /// The region.
        region: &'static str,
        /// Mask values from here on are inside.
        threshold: f32,
    },
    /// No pixel of the mask has a window that fits into the image.
    #[error(
        "{metric}: the map covers no pixel of the mask; expected a mask that reaches further from the border"
    )]
    NoCoveredPixel {
        /// Which variant refuses.
        metric: &'static str,
    },
    /// The value range of the images, which sets the constants of SSIM, is zero.
    #[error(
        "{metric}: both images are constant, so their value range is 0 and the index is 0/0; expected a range above 0"
    )]
    ZeroRange {
        /// Which variant refuses.
        metric: &'static str,
    },
    /// Settings that no metric can have.
    #[error("{field}: {problem}; expected {expected}")]
    Settings {
        /// The setting.
        field: &'static str,
        /// What is wrong with it.
        problem: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A protocol that does not exist or does not parse.
    #[error("protocol \"{id}\": {problem}; expected {expected}")]
    Protocol {
        /// As asked for.
        id: String,
        /// What is wrong with it.
        problem: String,
        /// What was expected.
        expected: String,
    },
    /// Scores that cannot be aggregated.
    #[error("frame {index}: {problem}; expected {expected}")]
    Frames {
        /// Position in the list.
        index: usize,
        /// What is wrong with it.
        problem: String,
        /// What was expected.
        expected: String,
    },
    /// The weights of an LPIPS network are not at hand.
    #[error("lpips: no weights for {net}; expected --lpips-weights FILE with the {net} network")]
    NoWeights {
        /// Its name.
        net: &'static str,
    },
    /// Regions that LPIPS has no meaning for.
    #[error("lpips: region \"{region}\" is a set of pixels; expected one that is an image")]
    NoImage {
        /// The region.
        region: &'static str,
    },
}

impl MetricsError {
    /// A [`MetricsError::Weights`].
    pub(crate) fn weights(
        field: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Weights { field: field.into(), problem: problem.into(), expected: expected.into() }
    }

    /// Whether it only says that there can be no LPIPS, of images that are sound.
    pub(crate) fn leaves_lpips_open(&self) -> bool {
        matches!(self, Self::NoWeights { .. } | Self::NoImage { .. } | Self::TooSmall { .. })
    }

    /// Checks a size against the render's.
    pub(crate) fn check_size(
        field: &'static str,
        found: (usize, usize),
        expected: (usize, usize),
    ) -> Result<(), Self> {
        if found == expected {
            return Ok(());
        }
        let ((found_width, found_height), (width, height)) = (found, expected);
        Err(Self::SizeMismatch { field, found_width, found_height, width, height })
    }
}
