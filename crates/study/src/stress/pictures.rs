//! Pictures of what breaks visibly: an arm whose second joint passes 180°, under one rotation choice each.

use super::report::Picture;
use super::stage;
use glam::DVec3;
use skinsplat_core::scene::{Camera, Image, PosedBody, RestBody};
use skinsplat_posing::{BoundAvatar, JointLift, PoseOptions, Poser, PosingError, RotationChoice};
use skinsplat_render::View;
use skinsplat_render::splat::render;

/// Degrees of the joint in the four panels.
const ANGLES: [f64; 4] = [150.0, 179.0, 181.0, 210.0];

/// Side of a panel, pixels.
const SIDE: usize = 192;

/// The rotation choices that are shown, the exact average first.
const SHOWN: [(&str, &str); 8] = [
    ("closed-form", "the exact average (Eq. 7)"),
    ("lifted-sum", "the remedy, signs nearest to the frame before"),
    ("power-15", "15 power steps, the paper's engine path"),
    ("nlerp", "the sum of quaternions on the side of the heaviest bone"),
    ("gram-schmidt-columns", "Gram-Schmidt over the columns of the blend"),
    ("matrix-to-quaternion-raw", "PyTorch3D's conversion, drawn as it is"),
    ("dual-quaternion", "dual quaternions, which also move the means"),
    ("face-splattingavatar", "the frame of the face under the Gaussian"),
];

/// A channel that differs by more shows: four levels of 8 bits.
const VISIBLE: f32 = 4.0 / 255.0;

/// A strip of poses for a twist and for a bend, for every choice of [`SHOWN`].
///
/// # Errors
/// None that the built-in body does not cause.
pub(super) fn draw(quick: bool) -> Result<Vec<Picture>, PosingError> {
    let body = stage::body()?;
    let bound = BoundAvatar::new(&stage::surface(&body), &body)?;
    let mut pictures = Vec::new();
    for (id, about) in SHOWN.iter().take(if quick { 2 } else { SHOWN.len() }) {
        let Ok(rotation) = id.parse::<RotationChoice>() else { continue };
        for (motion, axis) in [("twist", DVec3::X), ("bend", DVec3::Z)] {
            let image = strip(&body, &bound, rotation, axis)?;
            let panels = ANGLES.map(|a| format!("{a}°")).join(", ");
            let exact = pictures.iter().find(|p: &&Picture| p.file.starts_with(motion));
            let apart = exact.map_or_else(String::new, |exact| {
                format!(
                    "; {:.1} % of the pixels differ visibly from the exact average's",
                    differing(&image, &exact.image)
                )
            });
            let caption = format!("{motion} by {panels}: {id}, {about}{apart}.");
            pictures.push(Picture { file: format!("{motion}-{id}.png"), caption, image });
        }
    }
    Ok(pictures)
}

fn strip(
    body: &RestBody,
    bound: &BoundAvatar,
    rotation: RotationChoice,
    axis: DVec3,
) -> Result<Image, PosingError> {
    let target = stage::moving_joint(body);
    let camera = Camera::look_at(
        target + DVec3::new(0.0, 0.25, 0.6),
        target,
        DVec3::Y,
        260.0,
        SIDE as u32,
        SIDE as u32,
    );
    let view = View::new(&camera).over([1.0; 3]);
    let strategy = stage::plain(rotation);
    let mut strip = Image::filled(SIDE * ANGLES.len(), SIDE, [1.0; 3]);
    let (mut poser, mut lift) = (Poser::new(), None::<JointLift>);
    for (panel, degrees) in ANGLES.into_iter().enumerate() {
        let angle = axis * degrees.to_radians();
        let at = stage::bent(body, &[DVec3::ZERO, angle, DVec3::ZERO, DVec3::ZERO]);
        let posed_body = PosedBody::new(body, &at)?;
        let next = JointLift::next(lift.as_ref(), &posed_body);
        let options = PoseOptions { lift: Some(&next), ..PoseOptions::default() };
        let rendered = render(&poser.pose(bound, &posed_body, &strategy, &options)?, &view)?;
        lift = Some(next);
        let width = strip.width();
        for (y, row) in rendered.image.pixels().chunks(SIDE).enumerate() {
            strip.pixels_mut()[y * width + panel * SIDE..][..SIDE].copy_from_slice(row);
        }
    }
    Ok(strip)
}

/// Per cent of the pixels with a channel that differs by more than [`VISIBLE`].
fn differing(a: &Image, b: &Image) -> f64 {
    let apart = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > VISIBLE);
    let count = a.pixels().iter().zip(b.pixels()).filter(apart).count();
    100.0 * count as f64 / a.pixels().len() as f64
}
