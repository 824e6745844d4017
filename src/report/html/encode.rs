//! Pictures as a page holds them: JPEG, and errors in the colours of a scale.

use image::codecs::jpeg::JpegEncoder;
use image::imageops::{FilterType, crop_imm, resize};
use image::{Rgb, RgbImage};
use skinsplat_page::{Picture, Scale};

/// Quality of a JPEG, of 100.
const QUALITY: u8 = 88;

/// A picture of at most this longer side.
pub(super) fn picture(image: &RgbImage, side: u32) -> Picture {
    let longest = image.width().max(image.height()).max(1);
    let reduced = if longest > side {
        let scaled = |length: u32| (u64::from(length) * u64::from(side) / u64::from(longest)).max(1) as u32;
        Some(resize(image, scaled(image.width()), scaled(image.height()), FilterType::Triangle))
    } else {
        None
    };
    let image = reduced.as_ref().unwrap_or(image);
    let mut bytes = Vec::new();
    // A JPEG of 8-bit colours in memory fails only for sizes beyond its 65,535.
    let written = JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(image);
    debug_assert!(written.is_ok(), "{written:?}");
    Picture::new("image/jpeg", &bytes, [image.width() as usize, image.height() as usize])
}

/// The mean absolute difference of the colours, in the colours of the scale.
pub(super) fn error(image: &RgbImage, truth: &RgbImage, scale: Scale) -> RgbImage {
    RgbImage::from_fn(truth.width(), truth.height(), |x, y| {
        let (a, b) = (image.get_pixel_checked(x, y).copied().unwrap_or(Rgb([0; 3])), truth.get_pixel(x, y));
        let sum: f32 = (0..3).map(|c| (f32::from(a[c]) - f32::from(b[c])).abs()).sum();
        Rgb(scale.colour(sum / (3.0 * 255.0)))
    })
}

/// Side of a place that is shown enlarged, pixels: half of a small picture, and this at most.
const PLACE: u32 = 48;
/// Least side of a place.
const LEAST: u32 = 12;
/// Places that are shown.
const PLACES: usize = 2;

/// Upper left corners (x, y) and sides of the places where the pictures differ most among each other; none if there are fewer than two.
pub(super) fn places(pictures: &[&RgbImage]) -> Vec<[u32; 3]> {
    let [first, _, ..] = pictures else { return Vec::new() };
    let (width, height) = (first.width(), first.height());
    let side = (width.min(height) / 2).min(PLACE);
    if side < LEAST || pictures.iter().any(|p| p.dimensions() != first.dimensions()) {
        return Vec::new();
    }
    let steps = |length: u32| (0..=(length - side) / (side / 4)).map(move |i| i * (side / 4));
    let mut found: Vec<([u32; 2], u64)> = steps(height)
        .flat_map(|y| steps(width).map(move |x| [x, y]))
        .map(|at| (at, difference(pictures, at, side)))
        .collect();
    found.sort_by_key(|(_, size)| std::cmp::Reverse(*size));
    let mut chosen: Vec<[u32; 3]> = Vec::new();
    for ([x, y], size) in found {
        let apart = |&[a, b, _]: &[u32; 3]| a.abs_diff(x) >= side || b.abs_diff(y) >= side;
        if size > 0 && chosen.len() < PLACES && chosen.iter().all(apart) {
            chosen.push([x, y, side]);
        }
    }
    chosen
}

/// How far the pictures lie apart in a place: the sum over its values of the largest minus the smallest.
fn difference(pictures: &[&RgbImage], [x0, y0]: [u32; 2], side: u32) -> u64 {
    let mut sum = 0;
    for y in (y0..y0 + side).step_by(2) {
        for x in (x0..x0 + side).step_by(2) {
            for c in 0..3 {
                let values = pictures.iter().map(|picture| picture.get_pixel(x, y)[c]);
                let (low, high) = values.fold((255, 0), |(low, high), v| (v.min(low), v.max(high)));
                sum += u64::from(high - low);
            }
        }
    }
    sum
}

/// A place of a picture.
pub(super) fn place(image: &RgbImage, [x, y, side]: [u32; 3]) -> Picture {
    picture(&crop_imm(image, x, y, side, side).to_image(), PLACE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_where_pictures_differ_is_found() {
        let plain = RgbImage::from_pixel(200, 160, Rgb([90; 3]));
        let mut other = plain.clone();
        for (x, y) in [(150, 100), (151, 101), (152, 100), (160, 110)] {
            other.put_pixel(x, y, Rgb([255, 0, 0]));
            other.put_pixel(x, y + 1, Rgb([255, 0, 0]));
        }
        let found = places(&[&plain, &other]);
        let [x, y, side] = found[0];
        assert!((x..x + side).contains(&155) && (y..y + side).contains(&102), "{found:?}");
        assert_eq!(places(&[&plain, &plain]), Vec::<[u32; 3]>::new());
        assert_eq!(places(&[&plain]), Vec::<[u32; 3]>::new());
    }

    #[test]
    fn errors_have_the_colours_of_the_scale() {
        let (truth, image) =
            (RgbImage::from_pixel(2, 2, Rgb([0; 3])), RgbImage::from_pixel(2, 2, Rgb([255; 3])));
        let scale = Scale::to(0.25);
        assert_eq!(error(&image, &truth, scale).get_pixel(0, 0).0, scale.colour(1.0));
        assert_eq!(error(&truth, &truth, scale).get_pixel(1, 1).0, scale.colour(0.0));
    }
}
