//! One frame under a protocol.

use super::planes::{check_mask, exact_level};
use super::region::{bounding_box, inside};
use super::ssim::ssim_of_planes;
use super::{Background, ErrorSums, MetricsError, PerceptualDistance, Planes, Protocol, ProtocolId, Region};
use crate::scene::{Image, Mask};
use serde::{Deserialize, Serialize};

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
    fn rgb(&self) -> &'a Image {
        match self {
            Self::Straight { rgb, .. } | Self::Composited { rgb, .. } => rgb,
        }
    }

    fn mask(&self) -> Option<&'a Mask> {
        match self {
            Self::Straight { alpha, .. } => Some(alpha),
            Self::Composited { mask, .. } => *mask,
        }
    }
}

/// The metrics of one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameScore {
    /// The protocol that it was scored under.
    pub protocol: ProtocolId,
    /// Pixels that were compared.
    pub pixels: u64,
    /// Mean squared error of R, G and B, from which any aggregation can be made later.
    pub channel_mse: [f64; 3],
    /// Mean squared error over all values.
    pub mse: f64,
    /// dB; +inf for identical images, which JSON holds as `null`.
    #[serde(with = "infinite_as_null")]
    pub psnr: f64,
    /// SSIM.
    pub ssim: f64,
    /// LPIPS; `None` (`null`) means "not computed".
    pub lpips: Option<f64>,
}

/// The two images as the metrics see them, after steps 1 to 3 of [`Protocol`].
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The render.
    pub render: Planes,
    /// The truth.
    pub truth: Planes,
    /// For [`Region::Mask`]: 1 for pixels that count, 0 for others.
    pub weights: Option<Vec<f64>>,
}

impl Protocol {
    /// Scores a render, which was drawn over [`Protocol::background_colour`], without LPIPS.
    ///
    /// # Errors
    /// Images or masks of different sizes, values that are not finite, a missing or empty mask where the region needs
    /// one, a region too small for the SSIM window.
    pub fn score(&self, render: &Image, truth: Truth<'_>) -> Result<FrameScore, MetricsError> {
        self.score_with(render, truth, None)
    }

    /// As [`Protocol::score`]; LPIPS too if there is a scorer for it. LPIPS has no masked form: it stays `None` in
    /// [`Region::Mask`].
    ///
    /// # Errors
    /// As [`Protocol::score`], and those of the scorer.
    pub fn score_with(
        &self,
        render: &Image,
        truth: Truth<'_>,
        lpips: Option<&dyn PerceptualDistance>,
    ) -> Result<FrameScore, MetricsError> {
        let Prepared { render, truth, weights } = self.prepare(render, truth)?;
        let sums = ErrorSums::new(&render, &truth, weights.as_deref())?;
        let ssim =
            ssim_of_planes(&render, &truth, &self.ssim.settings(), self.ssim.id(), weights.as_deref())?;
        let lpips = match lpips {
            Some(scorer) if weights.is_none() => Some(scorer.distance(&render, &truth, self.lpips)?),
            _ => None,
        };
        Ok(FrameScore {
            protocol: self.key(),
            pixels: sums.pixels as u64,
            channel_mse: sums.channel_mse(),
            mse: sums.mse(),
            psnr: self.psnr.psnr(sums.channel_mse()),
            ssim,
            lpips,
        })
    }

    /// Steps 1 to 3: composite, clamp, quantise, cut out the region.
    ///
    /// # Errors
    /// As [`Protocol::score`], but for the SSIM window.
    pub fn prepare(&self, render: &Image, truth: Truth<'_>) -> Result<Prepared, MetricsError> {
        let size = (render.width(), render.height());
        let rgb = truth.rgb();
        MetricsError::check_size("truth", (rgb.width(), rgb.height()), size)?;
        if let Some(mask) = truth.mask() {
            let field = if matches!(truth, Truth::Straight { .. }) { "alpha" } else { "mask" };
            check_mask(mask, field, size)?;
        }
        let background = self.background_colour().unwrap_or_default().map(exact_level);
        let alpha = match (truth, self.background) {
            (Truth::Straight { alpha, .. }, Background::Colour(_)) => Some(alpha.values()),
            _ => None,
        };
        let outside = self.outside(truth.mask(), background)?;
        let width = render.width();
        let finish = |y: usize, rgb: [&mut [f64]; 3]| {
            for (c, values) in rgb.into_iter().enumerate() {
                self.clamp.apply(values);
                self.quantise.apply(values);
                outside.apply(y * width, c, values);
            }
        };
        let render = Planes::by_rows(render, "render", finish)?;
        let rgb = Planes::by_rows(rgb, "truth", |y, mut rgb| {
            if let Some(alpha) = alpha {
                for (values, background) in rgb.iter_mut().zip(background) {
                    composite(values, &alpha[y * width..], background);
                }
            }
            finish(y, rgb);
        })?;
        self.cut(render, rgb, truth.mask())
    }

    /// How the region changes pixels.
    fn outside<'a>(&self, mask: Option<&'a Mask>, background: [f64; 3]) -> Result<Outside<'a>, MetricsError> {
        let region = self.region;
        let mask = match mask {
            Some(mask) => mask.values(),
            None if region.needs_mask() => return Err(MetricsError::NoMask { region: region.id() }),
            None => return Ok(Outside::Kept),
        };
        Ok(match region {
            Region::Full | Region::MaskBoundingBox | Region::MaskBoundingBoxExclusive | Region::Mask => {
                Outside::Kept
            }
            Region::ImageTimesMask => Outside::Scaled { mask },
            Region::BackgroundOutsideMask => {
                Outside::Filled { mask, threshold: self.mask_threshold, colour: background }
            }
        })
    }

    /// Crops to the region, or adds its weights.
    fn cut(&self, render: Planes, truth: Planes, mask: Option<&Mask>) -> Result<Prepared, MetricsError> {
        let (region, threshold) = (self.region, self.mask_threshold);
        let crop = |mask: &Mask, exclusive: bool| {
            let empty = MetricsError::EmptyRegion { region: region.id(), threshold };
            let rect = bounding_box(mask, threshold, exclusive).ok_or(empty)?;
            Ok(Prepared { render: render.crop(&rect), truth: truth.crop(&rect), weights: None })
        };
        match (region, mask) {
            (Region::MaskBoundingBox, Some(mask)) => crop(mask, false),
            (Region::MaskBoundingBoxExclusive, Some(mask)) => crop(mask, true),
            (Region::Mask, Some(mask)) => {
                let weights = Some(inside(mask, threshold, region)?);
                Ok(Prepared { render, truth, weights })
            }
            _ => Ok(Prepared { render, truth, weights: None }),
        }
    }
}

/// What happens to pixels outside the mask.
enum Outside<'a> {
    /// Nothing.
    Kept,
    /// Every pixel is multiplied by its mask value.
    Scaled { mask: &'a [f32] },
    /// Pixels below the threshold take a colour.
    Filled { mask: &'a [f32], threshold: f32, colour: [f64; 3] },
}

impl Outside<'_> {
    /// Changes values of channel `channel`, the first of which belongs to pixel `start`.
    #[inline(always)]
    fn apply(&self, start: usize, channel: usize, values: &mut [f64]) {
        match *self {
            Self::Kept => (),
            Self::Scaled { mask } => {
                for (value, &mask) in values.iter_mut().zip(&mask[start..]) {
                    *value *= exact_level(mask);
                }
            }
            Self::Filled { mask, threshold, colour } => {
                for (value, &mask) in values.iter_mut().zip(&mask[start..]) {
                    *value = if mask >= threshold { *value } else { colour[channel] };
                }
            }
        }
    }
}

/// `v a + background (1 - a)`.
#[inline(always)]
fn composite(values: &mut [f64], alpha: &[f32], background: f64) {
    for (value, &alpha) in values.iter_mut().zip(alpha) {
        let alpha = exact_level(alpha);
        *value = *value * alpha + background * (1.0 - alpha);
    }
}

/// +inf as `null`.
pub(crate) mod infinite_as_null {
    use serde::{Deserialize, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    pub(crate) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() { serializer.serialize_f64(*value) } else { serializer.serialize_none() }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}
