//! Pictures by which a person judges the fit of body and images.

use super::project;
use skinsplat_core::scene::{Image, Mask};
use skinsplat_data::frames::save_png;
use skinsplat_data::{Error, Sequence};
use std::path::Path;

/// Longer side of an overlay, pixels.
const SIDE: u32 = 512;
/// Longer side of a picture on the contact sheet, pixels.
const THUMB: usize = 160;
/// Pictures on a contact sheet.
const ON_SHEET: usize = 24;
const COLUMNS: usize = 6;
/// The body's outline, and the mask's where they differ.
const BODY: [f32; 3] = [1.0, 0.15, 0.1];
const MASK: [f32; 3] = [0.1, 0.9, 0.3];

/// Writes `SEQUENCE/FRAME.png` for some frames, each image under the outlines of the body (red) and of the mask (green),
/// and `SEQUENCE.png`, a contact sheet of them.
///
/// # Errors
/// A folder that cannot be written; frames that cannot be read are left out.
pub fn write(sequence: &Sequence, frames: &[usize], folder: &Path) -> Result<(), Error> {
    let small = sequence.reduced(SIDE);
    let name = |text: &str| text.replace(['/', '\\'], "-");
    let own = folder.join(name(&sequence.id));
    std::fs::create_dir_all(&own).map_err(|cause| Error::write(&own, "folder", cause))?;
    let step = frames.len().div_ceil(ON_SHEET).max(1);
    let mut sheet = Vec::new();
    for (i, &index) in frames.iter().enumerate() {
        let Some(overlay) = overlay(&small, index) else { continue };
        save_png(&own.join(name(&small.frames[index].name) + ".png"), &overlay)?;
        if i % step == 0 {
            sheet.push(thumb(&overlay));
        }
    }
    match sheet.is_empty() {
        true => Ok(()),
        false => save_png(&folder.join(name(&sequence.id) + ".png"), &contact_sheet(&sheet)),
    }
}

fn overlay(small: &Sequence, index: usize) -> Option<Image> {
    let truth = small.truth(index).ok()?;
    let camera = &small.cameras[small.frames[index].camera];
    let (body, _) = project(small, index, camera).ok()?;
    let mut image = truth.rgb;
    outline(&mut image, &truth.alpha, MASK);
    outline(&mut image, &body, BODY);
    Some(image)
}

/// Colours the pixels of a mask that have a neighbour outside of it.
fn outline(image: &mut Image, mask: &Mask, colour: [f32; 3]) {
    let (width, height) = (mask.width(), mask.height());
    let inside = |x: usize, y: usize| mask.at(x, y) >= 0.5;
    for y in 0..height {
        for x in (0..width).filter(|&x| inside(x, y)) {
            let out = |nx: Option<usize>, ny: Option<usize>| match (nx, ny) {
                (Some(nx), Some(ny)) if nx < width && ny < height => !inside(nx, ny),
                _ => false,
            };
            let neighbours = [
                out(x.checked_sub(1), Some(y)),
                out(Some(x + 1), Some(y)),
                out(Some(x), y.checked_sub(1)),
                out(Some(x), Some(y + 1)),
            ];
            if neighbours.contains(&true) {
                image.pixels_mut()[y * width + x] = colour;
            }
        }
    }
}

/// A picture of at most [`THUMB`] pixels a side, of averages.
fn thumb(image: &Image) -> Image {
    let by = image.width().max(image.height()).div_ceil(THUMB).max(1);
    let (width, height) = ((image.width() / by).max(1), (image.height() / by).max(1));
    let pixel = |i: usize| {
        let (x, y) = (i % width * by, i / width * by);
        let mut sum = [0.0; 3];
        let mut count = 0.0;
        for v in y..(y + by).min(image.height()) {
            for u in x..(x + by).min(image.width()) {
                let rgb = image.at(u, v);
                sum = std::array::from_fn(|c| sum[c] + rgb[c]);
                count += 1.0;
            }
        }
        sum.map(|v| v / count)
    };
    Image::new(width, height, (0..width * height).map(pixel).collect()).expect("one value per pixel")
}

fn contact_sheet(thumbs: &[Image]) -> Image {
    let width = thumbs.iter().map(Image::width).max().unwrap_or(1) + 4;
    let height = thumbs.iter().map(Image::height).max().unwrap_or(1) + 4;
    let columns = thumbs.len().min(COLUMNS);
    let mut sheet = Image::filled(columns * width, thumbs.len().div_ceil(columns) * height, [1.0; 3]);
    let row = sheet.width();
    for (i, thumb) in thumbs.iter().enumerate() {
        let (x, y) = (i % columns * width + 2, i / columns * height + 2);
        for v in 0..thumb.height() {
            for u in 0..thumb.width() {
                sheet.pixels_mut()[(y + v) * row + x + u] = thumb.at(u, v);
            }
        }
    }
    sheet
}
