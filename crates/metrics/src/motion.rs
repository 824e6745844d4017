//! A frame and the one before it, for metrics of motion.

use super::{MetricsError, Planes, Prepared, Protocol, Truth};
use skinsplat_core::scene::{Image, Mask};

/// The frame before, which the same camera took.
#[derive(Clone, Copy, Debug)]
pub struct Before<'a> {
    /// Its render, drawn as the frame's own.
    pub render: &'a Image,
    /// Its truth.
    pub truth: Truth<'a>,
}

impl Protocol {
    /// The frame before and the frame, each after steps 1 to 3 of the protocol, both cut to the pixels that the protocol
    /// scores in either: their masks are united first.
    ///
    /// # Errors
    /// As [`Protocol::prepare`], for each; frames of different sizes.
    pub(crate) fn succession(
        &self,
        render: &Image,
        truth: Truth<'_>,
        before: Before<'_>,
    ) -> Result<[Prepared; 2], MetricsError> {
        let size = |image: &Image| (image.width(), image.height());
        MetricsError::check_size("frame before", size(before.render), size(render))?;
        let [earlier, now] = [self.finished(before.render, before.truth)?, self.finished(render, truth)?];
        let united = match (before.truth.mask(), truth.mask()) {
            (Some(a), Some(b)) => Some(either(a, b)),
            (mask, None) | (None, mask) => mask.cloned(),
        };
        let cut = |[render, truth]: [Planes; 2]| self.cut(render, truth, united.as_ref(), None);
        Ok([cut(earlier)?, cut(now)?])
    }
}

/// The larger value of each pixel of two masks of one size.
fn either(a: &Mask, b: &Mask) -> Mask {
    let mut united = a.clone();
    for (value, &other) in united.values_mut().iter_mut().zip(b.values()) {
        *value = value.max(other);
    }
    united
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameScore, MetricId, Wanted};

    const SIZE: usize = 16;

    fn grey(value: impl Fn(usize, usize) -> f32) -> Image {
        let pixel = |i: usize| [value(i % SIZE, i / SIZE); 3];
        Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(pixel).collect()).unwrap()
    }

    fn columns(inside: std::ops::Range<usize>) -> Mask {
        let value = |i: usize| f32::from(u8::from(inside.contains(&(i % SIZE))));
        Mask::new(SIZE, SIZE, (0..SIZE * SIZE).map(value).collect()).unwrap()
    }

    fn flicker(spec: &str, now: [&Image; 2], before: [&Image; 2], masks: [&Mask; 2]) -> f64 {
        let truth = |rgb, mask| Truth::Composited { rgb, mask: Some(mask) };
        let before = Ok(Before { render: before[0], truth: truth(before[1], masks[0]) });
        let wanted = Wanted { before, ..Wanted::of(&[MetricId::FLICKER]) };
        let score = Protocol::parse(spec).unwrap().score_with(now[0], truth(now[1], masks[1]), wanted);
        score.unwrap().value(MetricId::FLICKER).unwrap()
    }

    #[test]
    fn what_the_truth_changes_too_is_no_flicker() {
        let everywhere = columns(0..SIZE);
        let level = |k: u8| grey(move |_, _| f32::from(k) / 255.0);
        let ramp = grey(|x, y| (x + y) as f32 / 255.0);
        let of = |now: [&Image; 2], before: [&Image; 2]| flicker("default", now, before, [&everywhere; 2]);
        // A constant error moves with the truth.
        assert_eq!(of([&level(60), &level(50)], [&level(30), &level(20)]), 0.0);
        assert_eq!(of([&ramp, &ramp], [&level(9), &level(9)]), 0.0);
        // The render stands still by seven levels, and jumps by five.
        assert!((of([&level(20), &level(27)], [&level(20), &level(20)]) - 7.0).abs() < 1e-9);
        assert!((of([&level(25), &level(20)], [&level(20), &level(20)]) - 5.0).abs() < 1e-9);
    }

    /// An error of 8 levels that appears in column 0, of which a mask may hold nothing in the frame itself.
    #[test]
    fn the_region_is_that_of_either_frame() {
        let black = grey(|_, _| 0.0);
        let render = grey(|x, _| if x == 0 { 8.0 / 255.0 } else { 0.0 });
        let (left, right) = (columns(0..4), columns(4..8));
        let of = |region: &str, before: &Mask| {
            flicker(
                &format!("default+region={region}"),
                [&render, &black],
                [&black, &black],
                [before, &right],
            )
        };
        let close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        close(of("full", &left), 8.0 / 16.0);
        close(of("mask", &left), 8.0 / 8.0);
        close(of("mask-bounding-box", &left), 8.0 / 8.0);
        close(of("mask", &right), 0.0);
        close(of("mask-bounding-box", &right), 0.0);
    }

    #[test]
    fn what_is_not_known_is_named() {
        let image = grey(|_, _| 0.5);
        let truth = Truth::Composited { rgb: &image, mask: None };
        let metrics = [MetricId::FLICKER, MetricId::ROTATION_JUMPS];
        let score = |wanted: Wanted<'_>| -> Result<FrameScore, MetricsError> {
            Protocol::default().score_with(&image, truth, wanted)
        };
        let (before, rotation_jumps) = (Err("it is the first"), Err("a mesh has none"));
        let none = score(Wanted { before, rotation_jumps, ..Wanted::of(&metrics) }).unwrap();
        let expected = "frame before: it is the first; expected one that the same camera took";
        assert_eq!(none.not_computed[&MetricId::FLICKER], expected);
        assert!(
            none.not_computed[&MetricId::ROTATION_JUMPS].starts_with("rotations: a mesh has none; expected")
        );
        let counted = score(Wanted { rotation_jumps: Ok(3), ..Wanted::of(&metrics) }).unwrap();
        assert_eq!(counted.value(MetricId::ROTATION_JUMPS), Some(3.0));
        let small = Image::filled(SIZE, 4, [0.5; 3]);
        let before = Ok(Before { render: &small, truth });
        let error = score(Wanted { before, ..Wanted::of(&metrics) }).unwrap_err().to_string();
        assert_eq!(error, "frame before: 16x4 pixels; expected 16x16, the size of the render");
    }
}
