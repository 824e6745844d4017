//! The frames that an avatar is made from.

use super::Error;
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
    let kept = count.min(most_frames);
    let middle = |part: usize| (2 * part + 1) * count / (2 * kept);
    let frames = (0..kept).map(|part| sequence.frames[middle(part)].clone()).collect();
    Ok(Sequence { frames, ..sequence.clone() })
}
