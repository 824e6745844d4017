//! What can be wrong with the input of a metric.

use std::fmt;

/// Why a metric, or a protocol, refuses its input. Sizes are width x height in pixels.
#[derive(Clone, Debug, PartialEq)]
pub enum MetricsError {
    /// Two images, or an image and its mask, differ in size.
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
    Weights {
        /// The file as a whole, or a tensor.
        field: String,
        /// What is wrong.
        problem: String,
        /// What was expected.
        expected: String,
    },
    /// A metric of bent pixels, and nobody said how the body is bent.
    NoBend,
    /// The body shows too few pixels that are bent so far.
    FewBentPixels {
        /// Pixels.
        pixels: usize,
        /// Fewest of which the metric is taken.
        least: usize,
    },
    /// Angles of another image.
    BendSize {
        /// Values given.
        values: usize,
        /// Pixels of the images.
        pixels: usize,
    },
    /// A metric of motion, and nothing is known of the frame before.
    NoFrameBefore {
        /// Why, in a few words.
        why: String,
    },
    /// Rotations whose jumps nobody can count.
    NoRotations {
        /// Why, in a few words.
        why: String,
    },
    /// A region needs a mask and none was given.
    NoMask {
        /// The region.
        region: &'static str,
    },
    /// The region holds no pixel.
    EmptyRegion {
        /// The region.
        region: &'static str,
        /// Mask values from here on are inside.
        threshold: f32,
        /// The mask's largest value.
        largest: f32,
    },
    /// No pixel of the mask has a window that fits into the image.
    NoCoveredPixel {
        /// Which variant refuses.
        metric: &'static str,
    },
    /// The value range of the images, which sets the constants of SSIM, is zero.
    ZeroRange {
        /// Which variant refuses.
        metric: &'static str,
    },
    /// Settings that no metric can have.
    Settings {
        /// The setting.
        field: &'static str,
        /// What is wrong with it.
        problem: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A protocol that does not exist or does not parse.
    Protocol {
        /// As asked for.
        id: String,
        /// What is wrong with it.
        problem: String,
        /// What was expected.
        expected: String,
    },
    /// Scores that cannot be aggregated.
    Frames {
        /// Position in the list.
        index: usize,
        /// What is wrong with it.
        problem: String,
        /// What was expected.
        expected: String,
    },
    /// The weights of an LPIPS network are not at hand.
    NoWeights {
        /// Its name.
        net: &'static str,
    },
    /// Regions that LPIPS has no meaning for.
    NoImage {
        /// The region.
        region: &'static str,
    },
}

impl std::error::Error for MetricsError {}

/// One line: what, its problem, and what was expected.
impl fmt::Display for MetricsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, problem, expected): (&str, String, String) = match self {
            Self::SizeMismatch { field, found_width, found_height, width, height } => (
                field,
                format!("{found_width}x{found_height} pixels"),
                format!("{width}x{height}, the size of the render"),
            ),
            Self::NotFinite { field, x, y, channel, value } => {
                (field, format!("{value} in channel {channel} at x {x}, y {y}"), "a finite value".into())
            }
            Self::TooSmall { metric, width, height, minimum } => (
                metric,
                format!("the scored image has {width}x{height} pixels"),
                format!("at least {minimum}x{minimum}"),
            ),
            Self::NoBend => ("bend", "none given".into(), "a body whose joints are known".into()),
            Self::FewBentPixels { pixels, least } => {
                ("bend", format!("{pixels} pixels of the body are bent so far"), format!("at least {least}"))
            }
            Self::BendSize { values, pixels } => {
                ("bend", format!("{values} values"), format!("one per pixel, {pixels}"))
            }
            Self::NoFrameBefore { why } => {
                ("frame before", why.clone(), "one that the same camera took".into())
            }
            Self::NoRotations { why } => (
                "rotations",
                why.clone(),
                "Gaussians that a strategy turns from one frame to the next".into(),
            ),
            Self::NoMask { region } => ("mask", "none given".into(), format!("one, for region \"{region}\"")),
            Self::EmptyRegion { region, threshold, largest } => (
                "mask",
                format!("region \"{region}\" holds no pixel, the largest value is {largest}"),
                format!("at least one value of {threshold} or more"),
            ),
            Self::NoCoveredPixel { metric } => (
                metric,
                "the map covers no pixel of the mask".into(),
                "a mask that reaches further from the border".into(),
            ),
            Self::ZeroRange { metric } => (
                metric,
                "both images are constant, so their value range is 0 and the index is 0/0".into(),
                "a range above 0".into(),
            ),
            Self::NoWeights { net } => (
                "lpips",
                format!("no weights for {net}"),
                format!("--lpips-weights FILE with the {net} network"),
            ),
            Self::NoImage { region } => {
                ("lpips", format!("region \"{region}\" is a set of pixels"), "one that is an image".into())
            }
            Self::Weights { field, problem, expected } => (field, problem.clone(), expected.clone()),
            Self::Settings { field, problem, expected } => (field, problem.clone(), (*expected).into()),
            Self::Protocol { id, problem, expected } => {
                return write!(f, "protocol \"{id}\": {problem}; expected {expected}");
            }
            Self::Frames { index, problem, expected } => {
                return write!(f, "frame {index}: {problem}; expected {expected}");
            }
        };
        write!(f, "{what}: {problem}; expected {expected}")
    }
}

impl MetricsError {
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
