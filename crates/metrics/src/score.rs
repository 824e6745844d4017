//! One frame under a protocol.

use super::planes::{check_mask, exact_level};
use super::region::{bounding_box, empty, inside};
use super::{
    AvatarStats, Background, Before, ErrorSums, FrameInput, Measure, Measured, MetricId, MetricsError,
    PerceptualDistance, Planes, Protocol, ProtocolId, Region, Truth, Values,
};
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::{Image, Mask};
use std::collections::BTreeMap;

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
    /// The metrics that were wanted and could be computed.
    pub values: Values,
    /// Why those are missing that were wanted of the frame and could not be computed.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub not_computed: BTreeMap<MetricId, String>,
}

impl FrameScore {
    /// The value of a metric, if it was computed.
    pub fn value(&self, id: MetricId) -> Option<f64> {
        self.values.get(id)
    }

    /// Notes what a metric says, if it says anything.
    fn note(&mut self, id: MetricId, measured: Option<Measured>) {
        match measured {
            None => {}
            Some(Measured::Value(value)) => self.values.insert(id, value),
            Some(Measured::NotComputed(reason)) => {
                self.not_computed.insert(id, reason.to_string());
            }
        }
    }
}

/// What is computed of a frame besides the squared error, and from what.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    /// The metrics.
    pub metrics: &'a [MetricId],
    /// What computes LPIPS; without it, LPIPS is not computed.
    pub lpips: Option<&'a dyn PerceptualDistance>,
    /// The avatar that was drawn, for metrics of it.
    pub avatar: AvatarStats,
    /// By how much the body is bent where a pixel shows it: the widest angle between the joints that move the surface there,
    /// degrees, row by row; negative where there is no body. Metrics of bent pixels need it.
    pub bend: Option<&'a [f32]>,
    /// The frame before, for metrics of motion, or why there is none.
    pub before: Result<Before<'a>, &'a str>,
    /// Gaussians whose rotation jumped since the frame before ([`ROTATION_JUMP_DEGREES`](crate::ROTATION_JUMP_DEGREES)), or
    /// why nobody counted them.
    pub rotation_jumps: Result<u64, &'a str>,
}

impl<'a> Wanted<'a> {
    /// Metrics of two images, without LPIPS.
    pub fn of(metrics: &'a [MetricId]) -> Self {
        let unknown = "nobody said what it was";
        Self {
            metrics,
            lpips: None,
            avatar: AvatarStats::default(),
            bend: None,
            before: Err(unknown),
            rotation_jumps: Err(unknown),
        }
    }
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
    /// [`Wanted::bend`] of the pixels that are left.
    pub bend: Option<Vec<f32>>,
}

impl Protocol {
    /// Scores a render, which was drawn over [`Protocol::background_colour`], by every metric of two images that needs
    /// nothing else: all but LPIPS.
    ///
    /// # Errors
    /// Images or masks of different sizes, values that are not finite, a missing or empty mask where the region needs
    /// one, a region too small for the SSIM window.
    pub fn score(&self, render: &Image, truth: Truth<'_>) -> Result<FrameScore, MetricsError> {
        let metrics: Vec<MetricId> =
            MetricId::of_frames().filter(|id| id.metric().needs.is_empty()).collect();
        self.score_with(render, truth, Wanted::of(&metrics))
    }

    /// Scores a render by what is wanted. A metric that cannot be computed of images that are sound is named in
    /// [`FrameScore::not_computed`] with the reason: LPIPS if there are no weights for its network, if the image is too
    /// small for it, and in [`Region::Mask`], since LPIPS has no masked form.
    ///
    /// # Errors
    /// As [`Protocol::score`], and other errors of the metrics.
    pub fn score_with(
        &self,
        render: &Image,
        truth: Truth<'_>,
        wanted: Wanted<'_>,
    ) -> Result<FrameScore, MetricsError> {
        let images = self.prepare_with(render, truth, wanted.bend)?;
        let errors = ErrorSums::new(&images.render, &images.truth, images.weights.as_deref())?;
        let mut score = FrameScore {
            protocol: self.key(),
            pixels: errors.pixels as u64,
            channel_mse: errors.channel_mse(),
            mse: errors.mse(),
            values: Values::default(),
            not_computed: BTreeMap::new(),
        };
        let succession = match wanted.before {
            Ok(before) if wanted.metrics.contains(&MetricId::FLICKER) => {
                Ok(self.succession(render, truth, before)?)
            }
            Ok(_) => Err("nobody asked"),
            Err(why) => Err(why),
        };
        let frame = FrameInput {
            protocol: self,
            images: &images,
            errors: &errors,
            lpips: wanted.lpips,
            succession: succession.as_ref().map_err(|why| *why),
            rotation_jumps: wanted.rotation_jumps,
        };
        for &id in wanted.metrics {
            match id.metric().measure {
                Measure::Avatar(of) => score.note(id, of(&wanted.avatar).map(Measured::Value)),
                Measure::Frame { score: of, .. } => score.note(id, Some(of(&frame)?)),
            }
        }
        Ok(score)
    }

    /// Steps 1 to 3: composite, clamp, quantise, cut out the region.
    ///
    /// # Errors
    /// As [`Protocol::score`], but for the SSIM window.
    pub fn prepare(&self, render: &Image, truth: Truth<'_>) -> Result<Prepared, MetricsError> {
        self.prepare_with(render, truth, None)
    }

    /// [`Protocol::prepare`], with [`Wanted::bend`] beside the images.
    fn prepare_with(
        &self,
        render: &Image,
        truth: Truth<'_>,
        bend: Option<&[f32]>,
    ) -> Result<Prepared, MetricsError> {
        let [render, rgb] = self.finished(render, truth)?;
        self.cut(render, rgb, truth.mask(), bend)
    }

    /// Render and truth, composited, clamped and quantised, before anything is cut out.
    pub(crate) fn finished(&self, render: &Image, truth: Truth<'_>) -> Result<[Planes; 2], MetricsError> {
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
        Ok([render, rgb])
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
    pub(crate) fn cut(
        &self,
        render: Planes,
        truth: Planes,
        mask: Option<&Mask>,
        bend: Option<&[f32]>,
    ) -> Result<Prepared, MetricsError> {
        let (region, threshold) = (self.region, self.mask_threshold);
        if let Some(bend) = bend
            && bend.len() != render.pixels()
        {
            return Err(MetricsError::BendSize { values: bend.len(), pixels: render.pixels() });
        }
        let crop = |mask: &Mask, exclusive: bool| {
            let empty = || empty(mask, threshold, region);
            let rect = bounding_box(mask, threshold, exclusive).ok_or_else(empty)?;
            let bend = bend.map(|bend| rect.cut(bend, render.width()));
            Ok(Prepared { render: render.crop(&rect), truth: truth.crop(&rect), weights: None, bend })
        };
        let weights = match (region, mask) {
            (Region::MaskBoundingBox, Some(mask)) => return crop(mask, false),
            (Region::MaskBoundingBoxExclusive, Some(mask)) => return crop(mask, true),
            (Region::Mask, Some(mask)) => Some(inside(mask, threshold, region)?),
            _ => None,
        };
        Ok(Prepared { render, truth, weights, bend: bend.map(<[f32]>::to_vec) })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LpipsVariant;

    const SIZE: usize = 24;

    /// A gradient plus a constant per channel.
    fn gradient(offset: [f32; 3]) -> Image {
        let pixel = |i: usize| offset.map(|o| o + 0.2 * (i % SIZE) as f32 / SIZE as f32);
        Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(pixel).collect()).unwrap()
    }

    fn left_half() -> Mask {
        let value = |i: usize| f32::from(u8::from(i % SIZE < SIZE / 2));
        Mask::new(SIZE, SIZE, (0..SIZE * SIZE).map(value).collect()).unwrap()
    }

    fn protocol(changes: &str) -> Protocol {
        Protocol::parse(&format!("default+quantise=none{changes}")).unwrap()
    }

    #[test]
    fn a_straight_truth_is_composited_over_the_background() {
        let (truth, alpha) = (gradient([0.3; 3]), left_half());
        let render = truth.composited(&alpha, [1.0; 3]).unwrap();
        let straight = Truth::Straight { rgb: &truth, alpha: &alpha };
        let score = protocol("").score(&render, straight).unwrap();
        assert!(score.mse < 1e-15 && (score.value(MetricId::SSIM).unwrap() - 1.0).abs() < 1e-9, "{score:?}");
        let captured = protocol("+background=captured").score(&render, straight).unwrap();
        assert!(captured.mse > 0.1);
        let same = protocol("+background=captured").score(&truth, straight).unwrap();
        assert_eq!(same.value(MetricId::PSNR), Some(f64::INFINITY));
    }

    #[test]
    fn regions_choose_pixels() {
        let (render, truth) = (gradient([0.4, 0.3, 0.3]), gradient([0.3; 3]));
        // The render is off by 0.1 in red everywhere, and by 0.3 in blue where the mask is 0.
        let mask = left_half();
        let mut render = render;
        for (pixel, &inside) in render.pixels_mut().iter_mut().zip(mask.values()) {
            pixel[2] += 0.3 * (1.0 - inside);
        }
        let score = |region: &str| {
            let truth = Truth::Composited { rgb: &truth, mask: Some(&mask) };
            protocol(&format!("+region={region}")).score(&render, truth).unwrap()
        };
        let close = |score: FrameScore, pixels: u64, mse: [f64; 3]| {
            assert_eq!(score.pixels, pixels);
            for c in 0..3 {
                assert!((score.channel_mse[c] - mse[c]).abs() < 1e-7, "{score:?}");
            }
        };
        close(score("full"), 576, [0.01, 0.0, 0.045]);
        close(score("mask"), 288, [0.01, 0.0, 0.0]);
        close(score("mask-bounding-box"), 288, [0.01, 0.0, 0.0]);
        close(score("mask-bounding-box-exclusive"), 23 * 11, [0.01, 0.0, 0.0]);
        close(score("image-times-mask"), 576, [0.005, 0.0, 0.0]);
        close(score("background-outside-mask"), 576, [0.005, 0.0, 0.0]);
    }

    #[test]
    fn bad_input_is_named() {
        let (image, mask) = (gradient([0.3; 3]), left_half());
        let small = Image::filled(SIZE, 10, [0.5; 3]);
        let truth = Truth::Composited { rgb: &image, mask: None };
        let message = |result: Result<FrameScore, MetricsError>| result.unwrap_err().to_string();
        let plain = protocol("");
        assert_eq!(
            message(plain.score(&small, truth)),
            "truth: 24x24 pixels; expected 24x10, the size of the render"
        );
        let wide = Mask::filled(SIZE + 1, SIZE, 1.0);
        let wrong_alpha = Truth::Straight { rgb: &image, alpha: &wide };
        assert_eq!(
            message(plain.score(&image, wrong_alpha)),
            "alpha: 25x24 pixels; expected 24x24, the size of the render"
        );
        let small_truth = Truth::Composited { rgb: &small, mask: None };
        assert_eq!(
            message(plain.score(&small, small_truth)),
            "ssim_valid: the scored image has 24x10 pixels; expected at least 11x11"
        );
        let mut broken = image.clone();
        broken.pixels_mut()[SIZE + 2][1] = f32::NAN;
        assert_eq!(
            message(plain.score(&broken, truth)),
            "render: NaN in channel 1 at x 2, y 1; expected a finite value"
        );
        let masked = protocol("+region=mask");
        assert_eq!(
            message(masked.score(&image, truth)),
            "mask: none given; expected one, for region \"mask\""
        );
        let empty = Mask::filled(SIZE, SIZE, 0.25);
        for region in ["mask", "mask-bounding-box"] {
            let truth = Truth::Composited { rgb: &image, mask: Some(&empty) };
            let error = protocol(&format!("+region={region}")).score(&image, truth).unwrap_err();
            assert!(matches!(error, MetricsError::EmptyRegion { .. }), "{error}");
        }
        let mut corner = Mask::filled(SIZE, SIZE, 0.0);
        corner.values_mut()[0] = 1.0;
        let truth = Truth::Composited { rgb: &image, mask: Some(&corner) };
        let error = masked.score(&image, truth).unwrap_err();
        assert!(matches!(error, MetricsError::NoCoveredPixel { .. }), "{error}");
        let mut holed = mask;
        holed.values_mut()[5] = f32::INFINITY;
        let truth = Truth::Straight { rgb: &image, alpha: &holed };
        assert_eq!(
            message(plain.score(&image, truth)),
            "alpha: inf in channel 0 at x 5, y 0; expected a finite value"
        );
    }

    #[test]
    fn records_keep_infinity_and_absence() {
        let image = gradient([0.3; 3]);
        let score = protocol("").score(&image, Truth::Composited { rgb: &image, mask: None }).unwrap();
        let text = serde_json::to_string(&score).unwrap();
        assert!(text.contains("\"psnr\":null") && !text.contains("lpips"), "{text}");
        let read: FrameScore = serde_json::from_str(&text).unwrap();
        assert_eq!((read.value(MetricId::PSNR), &read), (Some(f64::INFINITY), &score));
        let without: FrameScore = serde_json::from_str(&text.replace("\"psnr\":null,", "")).unwrap();
        assert_eq!(without.value(MetricId::PSNR), None, "a missing PSNR is not +inf");
        assert!(serde_json::from_str::<FrameScore>(&text.replace("psnr", "beauty")).is_err());
    }

    struct MeanDifference;

    impl PerceptualDistance for MeanDifference {
        fn distance(
            &self,
            render: &Planes,
            truth: &Planes,
            variant: LpipsVariant,
        ) -> Result<f64, MetricsError> {
            assert_eq!(variant.id(), "alex-pm1");
            Ok(ErrorSums::new(render, truth, None)?.mae())
        }
    }

    #[test]
    fn a_scorer_fills_lpips_with_the_prepared_images() {
        let (render, truth, mask) = (gradient([0.4; 3]), gradient([0.3; 3]), left_half());
        let truth = Truth::Composited { rgb: &truth, mask: Some(&mask) };
        let wanted = Wanted { lpips: Some(&MeanDifference), ..Wanted::of(&[MetricId::LPIPS]) };
        let lpips = |changes: &str| {
            let score = protocol(changes).score_with(&render, truth, wanted).unwrap();
            assert_eq!(score.value(MetricId::SSIM), None);
            score
        };
        assert!((lpips("").value(MetricId::LPIPS).unwrap() - 0.1).abs() < 1e-7);
        let scaled = lpips("+region=image-times-mask");
        assert!((scaled.value(MetricId::LPIPS).unwrap() - 0.05).abs() < 1e-7);
        let masked = lpips("+region=mask");
        assert_eq!(masked.value(MetricId::LPIPS), None);
        let reason = "lpips: region \"mask\" is a set of pixels; expected one that is an image";
        assert_eq!(masked.not_computed[&MetricId::LPIPS], reason);
        let plain = protocol("").score(&render, truth).unwrap();
        assert!(plain.value(MetricId::LPIPS).is_none() && plain.not_computed.is_empty());
    }

    #[test]
    fn without_a_scorer_lpips_is_open_and_a_mesh_has_no_splats() {
        let image = gradient([0.3; 3]);
        let truth = Truth::Composited { rgb: &image, mask: None };
        let known = |id: &MetricId| !id.needs_bend() && !id.needs_before();
        let metrics: Vec<MetricId> = MetricId::all().filter(known).collect();
        let mesh = Wanted::of(&metrics);
        let score = protocol("").score_with(&image, truth, mesh).unwrap();
        assert!(score.not_computed.keys().eq(&[MetricId::LPIPS]), "{score:?}");
        assert_eq!(score.value(MetricId::SPLATS), None);
        let avatar = AvatarStats { gaussians: Some(7) };
        let score = protocol("").score_with(&image, truth, Wanted { avatar, ..mesh }).unwrap();
        assert_eq!(score.value(MetricId::SPLATS), Some(7.0));
    }
}
