//! Gaussians in another order than the rig's, found by their means, or by what no pose and no bug in posing changes.

use super::Error;
use super::judge::{Judge, Model};
use super::sample::{self, Field, Fields, Sample, range};

/// Refuses an answer whose means, or whose scales, opacities and SH of degree 0, are the right ones in another order.
///
/// # Errors
/// The first Gaussian that stands elsewhere, and how many do.
pub(crate) fn check(judge: &Judge<'_>, place: &str) -> Result<(), Error> {
    let Some(order) = permutation(judge).or_else(|| by_constants(judge)) else { return Ok(()) };
    let Some(first) = order.iter().enumerate().position(|(i, &at)| i != at) else { return Ok(()) };
    let moved = order.iter().enumerate().filter(|(i, at)| i != *at).count();
    let problem = format!(
        "another order of Gaussians: place {first} holds Gaussian {}, and {moved} of {} stand elsewhere",
        order[first],
        order.len()
    );
    Err(Error::new(place, problem, "the order of the rig"))
}

/// Which Gaussian of the rig stands at each place; `None` if the means are not those of the rig.
pub(crate) fn permutation(judge: &Judge<'_>) -> Option<Vec<usize>> {
    if !judge.answer.present.contains(Field::Means) {
        return None;
    }
    let gaussians = judge.pipeline.rig.len();
    let predicted = judge.predict(&Model::default());
    let units = judge.pipeline.convention.units;
    let mean = |samples: &[super::sample::Sample], at: usize| -> [f64; 3] {
        let start = range(Field::Means).start;
        std::array::from_fn(|k| samples[at][start + k] / units)
    };
    let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() <= judge.tolerance);
    let samples = &judge.answer.samples;
    let mut taken = vec![false; gaussians];
    let mut order = Vec::with_capacity(gaussians);
    for place in 0..gaussians {
        let found = mean(samples, place);
        let fits = |&i: &usize| !taken[i] && close(found, mean(&predicted, i));
        let gaussian = (place..gaussians).chain(0..place).find(fits)?;
        taken[gaussian] = true;
        order.push(gaussian);
    }
    let poses = samples.len() / gaussians;
    let same = |pose: usize| {
        (0..gaussians).all(|place| {
            let at = pose * gaussians;
            close(mean(samples, at + place), mean(&predicted, at + order[place]))
        })
    };
    (1..poses).all(same).then_some(order)
}

/// What a Gaussian keeps in every pose.
const CONSTANTS: [Field; 3] = [Field::Scales, Field::Opacities, Field::Sh0];

/// The same, found by what no pose changes: all of it together, else each by itself, since one of them may be wrong. `None` if
/// that tells no order, or several.
fn by_constants(judge: &Judge<'_>) -> Option<Vec<usize>> {
    let given: Fields = CONSTANTS.into_iter().filter(|&field| judge.answer.present.contains(field)).collect();
    let predicted = judge.predict(&Model::default());
    let alone = given.iter().map(|field| [field].into_iter().collect());
    let mut orders = std::iter::once(given).chain(alone).filter_map(|by| matched(judge, &predicted, by));
    let order = orders.next()?;
    orders.all(|other| other == order).then_some(order)
}

/// Which Gaussian of the rig has the fields of each place, in every pose; `None` if one has no such Gaussian, or several.
fn matched(judge: &Judge<'_>, predicted: &[Sample], by: Fields) -> Option<Vec<usize>> {
    let gaussians = judge.pipeline.rig.len();
    let poses = judge.answer.samples.len() / gaussians;
    let units = judge.pipeline.convention.units;
    let alike = |at: usize, i: usize| {
        let (found, expected) = (&judge.answer.samples[at], &predicted[i]);
        let off = |field: Field| {
            let range = range(field);
            sample::error(field, judge.answer.storage, units, &expected[range.clone()], &found[range])
        };
        by.iter().all(|field| off(field) <= judge.tolerance)
    };
    let everywhere =
        |place: usize, i: usize| (0..poses).map(|pose| pose * gaussians).all(|at| alike(at + place, at + i));
    let mut taken = vec![false; gaussians];
    let mut order = Vec::with_capacity(gaussians);
    for place in 0..gaussians {
        let mut fits = (0..gaussians).filter(|&i| everywhere(place, i));
        let (Some(gaussian), None) = (fits.next(), fits.next()) else { return None };
        if std::mem::replace(&mut taken[gaussian], true) {
            return None;
        }
        order.push(gaussian);
    }
    (!by.is_empty()).then_some(order)
}
