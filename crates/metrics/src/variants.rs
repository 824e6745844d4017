//! Every metric variant of one pair of images, by name: what `reproduce score` prints.

use super::protocol::{Captured, Clamp, Quantisation};
use super::ssim::{Border, ssim_of_planes, ssim_with_borders};
use super::{Background, ErrorSums, MetricsError, Protocol, PsnrVariant, Region, SsimVariant, Truth};
use skinsplat_core::scene::{Image, Mask};

macro_rules! ids {
    ($suffix:literal) => {
        [
            concat!("mse", $suffix),
            concat!("mae", $suffix),
            concat!("psnr", $suffix),
            concat!("psnr_mean_of_channels", $suffix),
            concat!("ssim_zero_pad", $suffix),
            concat!("ssim_valid", $suffix),
            concat!("ssim_reflect", $suffix),
            concat!("ssim_uniform7", $suffix),
        ]
    };
}

/// The regions of [`all_variants`] and the names of the metrics in each: `mse`, `mae`, `psnr` (over all values),
/// `psnr_mean_of_channels`, `ssim_zero_pad`, `ssim_valid`, `ssim_reflect` and `ssim_uniform7` (see [`SsimVariant`]) of the
/// whole image; with a mask also with the suffixes `_mask` (only masked pixels), `_bbox` (cropped to the mask's bounding
/// box) and `_image_times_mask` (both images multiplied by the mask).
pub const VARIANT_IDS: [(Region, [&str; 8]); 4] = [
    (Region::Full, ids!("")),
    (Region::Mask, ids!("_mask")),
    (Region::MaskBoundingBox, ids!("_bbox")),
    (Region::ImageTimesMask, ids!("_image_times_mask")),
];

/// A variant's name and its value, or why it refuses these images.
pub type VariantScore = (&'static str, Result<f64, MetricsError>);

/// All variants of [`VARIANT_IDS`], in that order, for two finished images; those that need a mask if there is one (inside
/// is 0.5 and above). Nothing is clamped or quantised. A PSNR of identical images is +inf.
///
/// # Errors
/// Images or a mask of different sizes, values that are not finite. A variant that an image is too small for, or the mask
/// too empty, is an error of its own in the list.
pub fn all_variants(
    render: &Image,
    truth: &Image,
    mask: Option<&Mask>,
) -> Result<Vec<VariantScore>, MetricsError> {
    let mut scores = Vec::new();
    for (region, ids) in VARIANT_IDS {
        if region.needs_mask() && mask.is_none() {
            continue;
        }
        let protocol = Protocol {
            background: Background::Captured(Captured::Captured),
            clamp: Clamp::None,
            quantise: Quantisation::None,
            region,
            mask_threshold: 0.5,
            ..Protocol::default()
        };
        let pair = match protocol.prepare(render, Truth::Composited { rgb: truth, mask }) {
            Err(empty @ MetricsError::EmptyRegion { .. }) => {
                scores.extend(ids.map(|id| (id, Err(empty.clone()))));
                continue;
            }
            pair => pair?,
        };
        let weights = pair.weights.as_deref();
        let sums = ErrorSums::new(&pair.render, &pair.truth, weights)?;
        let mse = sums.channel_mse();
        let errors =
            [sums.mse(), sums.mae(), PsnrVariant::Image.psnr(mse), PsnrVariant::MeanOfChannels.psnr(mse)];
        let borders = [Border::ZeroPad, Border::Valid, Border::Reflect];
        let borders = std::array::from_fn::<_, 3, _>(|i| (borders[i], ids[4 + i]));
        let settings = SsimVariant::Valid.settings();
        let gaussian = ssim_with_borders(&pair.render, &pair.truth, &settings, &borders, weights);
        let settings = SsimVariant::Uniform7.settings();
        let uniform = ssim_of_planes(&pair.render, &pair.truth, &settings, ids[7], weights);
        let values = errors.into_iter().map(Ok).chain(gaussian).chain([uniform]);
        scores.extend(ids.into_iter().zip(values));
    }
    Ok(scores)
}
