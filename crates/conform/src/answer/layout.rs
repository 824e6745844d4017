//! Arrays of an answer, whichever file they came from: which field, which poses, how wide.

use super::super::sample::{Field, Fields, Storage};
use super::super::{Error, Options};
use super::{Answer, Expected, blank, finite, put};

/// A named array, flat.
pub(super) struct Array {
    pub(super) name: String,
    pub(super) values: Vec<f64>,
    /// Extents as the file has them, where it says.
    pub(super) shape: Vec<usize>,
}

/// The names of arrays in answers, with the numbers per Gaussian that they may have.
const ARRAYS: [(&str, &[usize]); 7] = [
    ("means", &[3]),
    ("quaternions", &[4]),
    ("scales", &[3]),
    ("covariances", &[6, 9]),
    ("directions", &[3]),
    ("opacities", &[1]),
    ("sh", &[48, 27, 12, 3]),
];

/// True if an array of that name belongs to an answer.
pub(super) fn is_field(name: &str) -> bool {
    ARRAYS.iter().any(|(known, _)| *known == name)
}

/// An answer from its arrays; `frames` is which poses the file says that it holds.
///
/// # Errors
/// Another number of Gaussians or poses, other extents, numbers that are not finite, matrices that are not symmetric, poses that
/// the rig does not have.
pub(super) fn answer(
    arrays: Vec<Array>,
    frames: Option<Vec<usize>>,
    expected: &Expected,
) -> Result<Answer, Error> {
    let frames = checked_frames(frames, expected)?;
    let poses = frames.as_ref().map_or_else(|| poses_of(&arrays, expected), Vec::len);
    let frames = expected.poses_of(frames, poses)?;
    let mut answer = Answer {
        storage: Storage::Activated,
        frames,
        present: Fields::default(),
        samples: blank(poses, expected.gaussians),
        halves: Fields::default(),
        declared: None,
        notes: Vec::new(),
    };
    for array in arrays {
        take(&mut answer, array, poses, expected)?;
    }
    Ok(answer)
}

fn checked_frames(frames: Option<Vec<usize>>, expected: &Expected) -> Result<Option<Vec<usize>>, Error> {
    let Some(frames) = frames else { return Ok(None) };
    let mut seen = vec![false; expected.poses];
    for &frame in &frames {
        if frame >= expected.poses || std::mem::replace(&mut seen[frame], true) {
            let expected = format!("poses below {}, each once", expected.poses);
            return Err(Error::new("frames", format!("pose {frame}"), expected));
        }
    }
    Ok(Some(frames))
}

/// One if every array is of one pose, else those of the rig.
fn poses_of(arrays: &[Array], expected: &Expected) -> usize {
    let one =
        |array: &Array| widths(&array.name).iter().any(|w| array.values.len() == w * expected.gaussians);
    if !arrays.is_empty() && arrays.iter().all(one) && expected.poses > 1 { 1 } else { expected.poses }
}

fn widths(name: &str) -> &'static [usize] {
    ARRAYS.iter().find(|(known, _)| *known == name).map_or(&[], |(_, widths)| widths)
}

fn take(answer: &mut Answer, array: Array, poses: usize, expected: &Expected) -> Result<(), Error> {
    let gaussians = expected.gaussians;
    let fits = |&&width: &&usize| array.values.len() == width * gaussians * poses;
    // What no pose changes may be given once.
    let once = |&&width: &&usize| {
        ["scales", "opacities"].contains(&array.name.as_str()) && array.values.len() == width * gaussians
    };
    let widths = widths(&array.name);
    let Some(&width) = widths.iter().find(fits).or_else(|| widths.iter().find(once)) else {
        return Err(wrong_count(&array, widths[0], poses, expected));
    };
    finite(&array.name, &array.values, gaussians, width)?;
    let given = array.values.len() / (width * gaussians);
    shaped(&array, width, given, gaussians)?;
    if array.name == "covariances" && width == 9 {
        symmetric(&array, gaussians)?;
    }
    let mut values = array.values;
    if values.len() < width * gaussians * poses {
        values = values.repeat(poses);
    }
    let single = |answer: &mut Answer, field: Field, values: &[f64]| {
        put(&mut answer.samples, field, values);
        answer.present.insert(field);
    };
    match array.name.as_str() {
        "means" => single(answer, Field::Means, &values),
        "quaternions" => single(answer, Field::Quaternions, &values),
        "scales" => single(answer, Field::Scales, &values),
        "directions" => single(answer, Field::Directions, &values),
        "opacities" => single(answer, Field::Opacities, &values),
        "covariances" if width == 9 => {
            let upper = |m: &[f64]| [m[0], m[1], m[2], m[4], m[5], m[8]];
            let values: Vec<f64> = values.chunks_exact(9).flat_map(upper).collect();
            single(answer, Field::Covariances, &values);
        }
        "covariances" => single(answer, Field::Covariances, &values),
        _ => take_sh(answer, &values, width),
    }
    Ok(())
}

/// Refuses extents in another order than pose, Gaussian, number: as many numbers lie elsewhere in them.
fn shaped(array: &Array, width: usize, poses: usize, gaussians: usize) -> Result<(), Error> {
    let mut tails = vec![vec![width]];
    match (array.name.as_str(), width) {
        ("opacities", _) => tails.push(Vec::new()),
        ("covariances", 9) => tails.push(vec![3, 3]),
        ("sh", _) => tails.push(vec![width / 3, 3]),
        _ => {}
    }
    // The only pose needs no extent of its own.
    let heads =
        if poses == 1 { vec![vec![1, gaussians], vec![gaussians]] } else { vec![vec![poses, gaussians]] };
    let fits = |head: &Vec<usize>| tails.iter().any(|tail| array.shape == [head.as_slice(), tail].concat());
    if array.shape.len() < 2 || heads.iter().any(fits) {
        return Ok(());
    }
    let product = |shape: &[usize]| shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ");
    let tail = tails.pop().unwrap_or_default();
    let expected = product(&[&[poses, gaussians], tail.as_slice()].concat());
    let expected = format!("{expected} (pose, Gaussian, numbers), or one flat list");
    Err(Error::new(&array.name, product(&array.shape), expected))
}

/// Refuses 3x3 matrices that are no covariances.
fn symmetric(array: &Array, gaussians: usize) -> Result<(), Error> {
    for (at, m) in array.values.chunks_exact(9).enumerate() {
        let largest = m.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let apart = |&(a, b): &(usize, usize)| (m[a] - m[b]).abs() > Options::TOLERANCE * largest;
        if let Some((a, b)) = [(1, 3), (2, 6), (5, 7)].into_iter().find(apart) {
            let place = format!("{}[{}][{}]", array.name, at / gaussians, at % gaussians);
            let problem = format!("{} above the diagonal and {} below", m[a], m[b]);
            return Err(Error::new(place, problem, "a symmetric matrix"));
        }
    }
    Ok(())
}

/// As many bands as `width` numbers per Gaussian hold.
pub(super) fn take_sh(answer: &mut Answer, values: &[f64], width: usize) {
    for (degree, field) in Field::SH.into_iter().enumerate() {
        let (start, end) = (3 * degree * degree, 3 * (degree + 1) * (degree + 1));
        if end <= width {
            let band: Vec<f64> = values.chunks_exact(width).flat_map(|v| v[start..end].to_vec()).collect();
            put(&mut answer.samples, field, &band);
            answer.present.insert(field);
        }
    }
}

/// What is wrong with the size of an array, in the terms that its extents allow.
fn wrong_count(array: &Array, width: usize, poses: usize, expected: &Expected) -> Error {
    let gaussians = expected.gaussians;
    let wanted = format!("{poses} poses of {gaussians} Gaussians, {width} numbers each");
    let problem = match array.shape.as_slice() {
        [found, _, ..] if *found != poses && *found != gaussians => format!("{found} poses"),
        [_, found, _, ..] if *found != gaussians => format!("{found} Gaussians"),
        [_, found] if array.name == "opacities" && *found != gaussians => format!("{found} Gaussians"),
        _ => format!("{} numbers", array.values.len()),
    };
    Error::new(&array.name, problem, wanted)
}
