//! Poses from named arrays: `.npz` archives and pickled dictionaries.

use super::angles::{Angles, Hands, Track};
use super::names;
use super::part::Part;
use super::{Keys, PoseTrack};
use crate::Error;
use crate::arrays::Arrays;
use crate::npy::Array;
use glam::DVec3;
use std::path::Path;

/// True if the file has the arrays of a motion.
pub(super) fn is_motion(file: &Arrays) -> bool {
    first(file, names::WHOLE).is_some()
        || names::PARTS[..2].iter().any(|(_, names)| first(file, names).is_some())
}

/// Reads a motion: one array of all joints ([`names::WHOLE`]), or parts ([`names::PARTS`]) of which the root and the body must
/// be there.
pub(super) fn load(path: &Path) -> Result<PoseTrack, Error> {
    let mut file = Arrays::open(path, "poses")?;
    let tracks = tracks(&mut file)?;
    let frames = tracks.first().map_or(0, |track| track.values.len() / track.width.max(1));
    let mut notes = Vec::new();
    let angles = Angles {
        tracks,
        translations: translations(&mut file, frames)?,
        scales: scales(&mut file, frames)?,
        hands: hands(&mut file)?,
    };
    if let Some(&scale) = angles.scales.first() {
        let varying = if angles.scales.iter().any(|s| *s != scale) { ", varying" } else { "" };
        notes.push(format!("the body is scaled by {scale}{varying} before the translation is added"));
    }
    let betas = betas(&mut file)?;
    let expression = expression(&mut file, &mut notes)?;
    let unread: Vec<String> = file
        .names()
        .into_iter()
        .filter(|name| !names::is_known(name))
        .map(|name| name.escape_debug().to_string())
        .collect();
    if !unread.is_empty() {
        notes.push(format!("not read: {}", unread.join(", ")));
    }
    contradictions(&mut file, &mut notes)?;
    passed_over(&mut file, &angles, &mut notes)?;
    let framerate = first(&file, names::FRAMERATE)
        .and_then(|name| file.array(name).ok().flatten()?.values.first().copied());
    let gender =
        file.contains("gender").then(|| file.text("gender").ok().flatten()?.first().cloned()).flatten();
    Ok(PoseTrack {
        betas,
        expression,
        gender,
        framerate,
        notes,
        path: path.to_owned(),
        keys: Keys::Angles(angles),
    })
}

/// Says which arrays are passed over for another of the same meaning, where they hold other numbers.
fn contradictions(file: &mut Arrays, notes: &mut Vec<String>) -> Result<(), Error> {
    for names in names::synonyms() {
        let there: Vec<&str> = names.iter().copied().filter(|name| file.contains(name)).collect();
        let Some((read, others)) = there.split_first() else { continue };
        for other in others {
            if file.array(read)?.map(|array| array.values) != file.array(other)?.map(|array| array.values) {
                notes.push(format!("{other}: not read, as {read} is there too and holds other numbers"));
            }
        }
    }
    Ok(())
}

/// Says which parts are passed over because one array has all of them, or because the left and the right one are there, where they
/// hold other numbers.
fn passed_over(file: &mut Arrays, angles: &Angles, notes: &mut Vec<String>) -> Result<(), Error> {
    let known: Vec<String> = file.names();
    let there =
        |names: &[&'static str]| names.iter().copied().find(|name| known.iter().any(|own| own == name));
    let others =
        names::PARTS.iter().map(|(_, names)| *names).chain(names::PAIRS.iter().map(|(.., names)| *names));
    if others.filter(|names| there(names).is_some()).count() + usize::from(angles.is_whole())
        <= angles.tracks.len()
    {
        return Ok(());
    }
    let parts = angles.parts();
    let of = |part: Part| parts.iter().find(|track| track.part == part);
    let mut compare = |name: &str, read: Option<Vec<f64>>| -> Result<(), Error> {
        let values = file.array(name)?.map(|array| array.values).unwrap_or_default();
        // A part that is not in the other array rests.
        if read.map_or(values.iter().any(|v| *v != 0.0), |read| read != values) {
            notes.push(format!("{name}: not read, as another array has the part, with other numbers"));
        }
        Ok(())
    };
    for (part, names) in names::PARTS {
        if let Some(name) = there(names) {
            compare(name, of(part).map(|track| track.values.clone()))?;
        }
    }
    for (left, right, names) in names::PAIRS {
        if let Some(name) = there(names) {
            compare(name, of(left).zip(of(right)).map(|(left, right)| left.beside(right)))?;
        }
    }
    Ok(())
}

/// The first of several names that the file has.
fn first(file: &Arrays, names: &[&'static str]) -> Option<&'static str> {
    names.iter().copied().find(|name| file.contains(name))
}

fn tracks(file: &mut Arrays) -> Result<Vec<Track>, Error> {
    if let Some(name) = first(file, names::WHOLE) {
        let (array, width) = rows(file, name)?;
        return Ok(vec![track(file, name, Part::Whole, array, width)?]);
    }
    let mut tracks = Vec::new();
    for (part, names) in names::PARTS {
        if let Some(name) = first(file, names) {
            let (array, width) = rows(file, name)?;
            tracks.push(track(file, name, part, array, width)?);
        } else if part == Part::GlobalOrient || part == Part::BodyPose {
            let expected =
                "thetas, poses or smpl_poses (T,3J), or global_orient (T,3) and body_pose (T,63 or T,69)";
            return Err(file.missing(part.name(), expected));
        }
    }
    for (left, right, names) in names::PAIRS {
        let has_one = tracks.iter().any(|track| track.part == left || track.part == right);
        if let (Some(name), false) = (first(file, names), has_one) {
            let (array, width) = rows(file, name)?;
            let half = |right: bool| -> Vec<f64> {
                let start = if right { width / 2 } else { 0 };
                array
                    .chunks_exact(width)
                    .flat_map(|row| row[start..start + width / 2].iter().copied())
                    .collect()
            };
            if !width.is_multiple_of(2) {
                return Err(file.invalid(
                    name,
                    format!("{width} values per frame"),
                    "as many for the left as for the right",
                ));
            }
            tracks.push(track(file, name, left, half(false), width / 2)?);
            tracks.push(track(file, name, right, half(true), width / 2)?);
        }
    }
    Ok(tracks)
}

/// True if the file translates more than one pose.
fn has_several_translations(file: &mut Arrays) -> Result<bool, Error> {
    let Some(name) = first(file, names::TRANSLATION) else { return Ok(false) };
    Ok(file.array(name)?.is_some_and(|array| array.values.len() > 3))
}

/// A (T, n) array, a (T, J, 3) one, or a single frame (n), as values and n.
fn rows(file: &mut Arrays, name: &str) -> Result<(Vec<f64>, usize), Error> {
    let axes = file.array(name)?.map_or(2, |array| array.shape.len());
    let single = axes == 1 && !has_several_translations(file)?;
    let array = file.require(
        name,
        match axes {
            1 if single => "*",
            3 => "T,*,3",
            _ => "T,*",
        },
    )?;
    let width: usize = if axes == 1 { array.shape[0] } else { array.shape[1..].iter().product() };
    if width == 0 || array.values.is_empty() {
        return Err(file.invalid(
            name,
            format!("shape {:?}", array.shape),
            "at least one frame of axis-angle triples",
        ));
    }
    Ok((array.values, width))
}

fn track(file: &mut Arrays, name: &str, part: Part, values: Vec<f64>, width: usize) -> Result<Track, Error> {
    let principal = part.is_hand() && (width != 45 || flag(file, "use_pca")? == Some(true));
    let fits = match part.joints() {
        _ if principal => (1..=45).contains(&width),
        [] => width.is_multiple_of(3),
        counts => counts.iter().any(|&count| 3 * count == width),
    };
    if fits {
        return Ok(Track { part, width, principal, values });
    }
    let expected = match part.joints() {
        _ if part.is_hand() => "45 (axis-angle) or at most 45 principal coefficients".to_owned(),
        [] => "axis-angle triples".to_owned(),
        counts => format!("{}", 3 * counts[0]),
    };
    Err(file.invalid(name, format!("{width} values per frame"), expected))
}

/// A truth value of any kind.
fn flag(file: &mut Arrays, name: &str) -> Result<Option<bool>, Error> {
    Ok(match file.contains(name) {
        true => file.array(name)?.and_then(|array| array.values.first().map(|v| *v != 0.0)),
        false => None,
    })
}

fn hands(file: &mut Arrays) -> Result<Option<Hands>, Error> {
    Ok(flag(file, "flat_hand_mean")?.map(|flat| if flat { Hands::Flat } else { Hands::Mean }))
}

fn translations(file: &mut Arrays, frames: usize) -> Result<Vec<DVec3>, Error> {
    let Some(name) = first(file, names::TRANSLATION) else { return Ok(vec![DVec3::ZERO; frames]) };
    let single = frames == 1 && file.array(name)?.is_some_and(|array| array.shape.len() == 1);
    let array = file.require(name, if single { "3" } else { "*,3" })?;
    per_frame(file, name, &array, 3, frames)?;
    Ok(array.values.chunks_exact(3).map(DVec3::from_slice).collect())
}

fn per_frame(file: &Arrays, name: &str, array: &Array, width: usize, frames: usize) -> Result<(), Error> {
    let rows = array.values.len() / width;
    if rows == frames {
        return Ok(());
    }
    Err(file.invalid(name, format!("shape {:?}", array.shape), format!("{frames} rows, one per pose")))
}

/// The scale of every frame; none if all are 1.
fn scales(file: &mut Arrays, frames: usize) -> Result<Vec<f64>, Error> {
    let Some(name) = first(file, names::SCALE) else { return Ok(Vec::new()) };
    let Some(array) = file.array(name)? else { return Ok(Vec::new()) };
    if let Some(i) = array.values.iter().position(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(file.invalid(
            format!("{name}[{i}]"),
            format!("{}", array.values[i]),
            "a finite factor above 0",
        ));
    }
    let scales = match array.values[..] {
        [one] => vec![one; frames],
        _ => {
            per_frame(file, name, &array, 1, frames)?;
            array.values
        }
    };
    Ok(if scales.iter().all(|s| *s == 1.0) { Vec::new() } else { scales })
}

fn betas(file: &mut Arrays) -> Result<Vec<f64>, Error> {
    let Some(name) = first(file, names::BETAS) else { return Ok(Vec::new()) };
    let axes = file.array(name)?.map_or(1, |array| array.shape.len());
    let array = file.require(name, if axes == 2 { "N,B" } else { "B" })?;
    let count = array.shape.last().copied().unwrap_or_default().max(1);
    let mut rows = array.values.chunks_exact(count);
    let first = rows.next().unwrap_or_default();
    if let Some(i) = rows.position(|row| row != first) {
        let field = format!("{name}[{}]", i + 1);
        return Err(file.invalid(
            field,
            format!("differs from {name}[0]"),
            "one shape for the whole sequence",
        ));
    }
    Ok(first.to_vec())
}

/// The expression, if it is the same in all frames: a body has one shape, and its joints follow the expression.
fn expression(file: &mut Arrays, notes: &mut Vec<String>) -> Result<Vec<f64>, Error> {
    let Some(array) = file.array("expression")? else { return Ok(Vec::new()) };
    let array = file.require("expression", if array.shape.len() == 1 { "E" } else { "*,E" })?;
    let count = array.shape.last().copied().unwrap_or_default().max(1);
    let mut rows = array.values.chunks_exact(count);
    let first = rows.next().unwrap_or_default();
    if rows.all(|row| row == first) {
        return Ok(first.to_vec());
    }
    notes.push("expression: it changes from frame to frame, which is not read; left out".into());
    Ok(Vec::new())
}
