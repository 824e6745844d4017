//! The frames that an avatar is made from.

use super::Error;
use glam::DVec3;
use skinsplat_data::sequence::Sequence;

/// A sequence of which an avatar can be made, thinned to at most `most_frames` frames: the middle one of each of as many
/// equal parts.
pub(super) fn prepared(sequence: &Sequence, most_frames: usize) -> Result<Sequence, Error> {
    let count = sequence.frames.len();
    if count == 0 {
        return Err(Error::invalid(format!("sequence {}: frames", sequence.id), "none", "at least one"));
    }
    if most_frames == 0 {
        return Err(Error::invalid("most_frames", "0", "at least 1"));
    }
    sequence.body.validate().map_err(Error::scene(sequence))?;
    if sequence.body.faces.is_empty() {
        return Err(Error::invalid(format!("sequence {}: body", sequence.id), "no faces", "a surface"));
    }
    check_extent(sequence)?;
    let kept = count.min(most_frames);
    let middle = |part: usize| (2 * part + 1) * count / (2 * kept);
    let frames = (0..kept).map(|part| sequence.frames[middle(part)].clone()).collect();
    Ok(Sequence { frames, ..sequence.clone() })
}

/// The largest extent of a body's surface, metres: edges are halved until they are millimetres long, and a body in other
/// units takes all memory.
const LARGEST_EXTENT: f64 = 10.0;
/// The smallest, metres: no person, in whatever units.
const SMALLEST_EXTENT: f64 = 0.01;

fn check_extent(sequence: &Sequence) -> Result<(), Error> {
    let body = &*sequence.body;
    let corners = || body.faces.iter().flatten().map(|&i| body.vertices[i as usize]);
    let (low, high) = corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    let extent = (high - low).max_element();
    if (SMALLEST_EXTENT..=LARGEST_EXTENT).contains(&extent) {
        return Ok(());
    }
    let size = if (0.1..1e4).contains(&extent) { format!("{extent:.1}") } else { format!("{extent:e}") };
    let field = format!("sequence {}: body", sequence.id);
    let expected = if extent < SMALLEST_EXTENT {
        format!("at least {SMALLEST_EXTENT} m: vertices in metres")
    } else {
        format!("at most {LARGEST_EXTENT} m: vertices in metres (are these centimetres?)")
    };
    Err(Error::invalid(field, format!("its surface is {size} m across"), expected))
}
