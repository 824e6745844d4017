//! Gaussians in another order than the rig's, found by their means.

use super::Error;
use super::judge::{Judge, Model};
use super::sample::{Field, range};

/// Refuses an answer whose means are the right ones in another order.
///
/// # Errors
/// The first Gaussian that stands elsewhere, and how many do.
pub(crate) fn check(judge: &Judge<'_>, place: &str) -> Result<(), Error> {
    let Some(order) = permutation(judge) else { return Ok(()) };
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
