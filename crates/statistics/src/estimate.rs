//! What differences come to.

use super::autocorrelation::{Candidate, effective};
use super::interval::{Interval, candidates, over_subjects, within};
use super::series::{Error, Series, Subject, mean, subjects};

/// How a candidate differs from a baseline in one metric.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Estimate {
    /// Mean difference: frames averaged in a sequence, sequences in a subject and seed, seeds in a subject, subjects.
    pub mean: f64,
    /// 95 % interval of the mean; none from too few frames of one subject.
    pub interval: Option<Interval>,
    /// Of how many independent frames the frames have the information, expected under their autocorrelation.
    pub effective_frames: f64,
    /// Share of the frames, averaged over seeds, in which the candidate is better; a tie counts half.
    pub win_rate: f64,
    /// Subjects.
    pub subjects: usize,
    /// Seeds; the most that a subject has.
    pub seeds: usize,
    /// Frames, each counted once for all seeds.
    pub frames: usize,
}

/// Sums up differences. See the [crate] for what the interval is.
///
/// # Errors
/// No frame, numbers that are not finite, or seeds of a subject whose frames are not the same.
pub fn estimate(series: &[Series], higher_is_better: bool) -> Result<Estimate, Error> {
    let subjects = subjects(series)?;
    let frames = || subjects.iter().flat_map(|subject| &subject.sequences).flatten();
    let wins = |&d: &f64| match d {
        0.0 => 0.5,
        d if (d > 0.0) == higher_is_better => 1.0,
        _ => 0.0,
    };
    let means: Vec<f64> = subjects.iter().map(Subject::mean).collect();
    let candidates: Vec<Vec<Candidate>> = subjects.iter().map(candidates).collect();
    let interval = match &subjects[..] {
        [subject] => within(subject, &candidates[0]),
        several => Some(over_subjects(several)),
    };
    let effective_frames = subjects.iter().zip(&candidates).map(|(s, c)| effective_frames(s, c)).sum();
    Ok(Estimate {
        mean: mean(&means),
        interval,
        effective_frames,
        win_rate: frames().map(wins).sum::<f64>() / frames().count() as f64,
        subjects: subjects.len(),
        seeds: subjects.iter().map(|subject| subject.seeds.len()).max().unwrap_or(0),
        frames: frames().count(),
    })
}

/// Of a subject. Frames that do not differ at all, and single ones, count as independent.
fn effective_frames(subject: &Subject, candidates: &[Candidate]) -> f64 {
    if candidates.is_empty() {
        return subject.sequences.iter().map(Vec::len).sum::<usize>() as f64;
    }
    effective(candidates)
}

#[cfg(test)]
mod tests {
    use super::super::Covers;
    use super::*;
    use proptest::prelude::{prop_assert, prop_assert_eq, proptest};
    use skinsplat_core::math::portable;
    use skinsplat_core::math::random::SplitMix64;

    fn series(subject: &str, seed: u64, sequence: &str, values: &[f64]) -> Series {
        Series { subject: subject.into(), seed, sequence: sequence.into(), values: values.to_vec() }
    }

    fn of_one(values: &[f64]) -> Estimate {
        estimate(&[series("a", 0, "s", values)], true).expect("finite")
    }

    #[test]
    fn constant_differences_have_a_point_interval() {
        let found = of_one(&[0.1; 12]);
        let interval = found.interval.expect("enough frames");
        assert!((interval.low - 0.1).abs() < 1e-15 && (interval.high - 0.1).abs() < 1e-15);
        assert_eq!((found.win_rate, found.frames, found.effective_frames), (1.0, 12, 12.0));
        let lower = estimate(&[series("a", 0, "s", &[0.1; 12])], false).expect("finite");
        assert_eq!(lower.win_rate, 0.0);
    }

    /// Two sequences of one subject and one of another: 1 and 0 average to 0.5, with 3 to 1.75.
    #[test]
    fn every_level_is_averaged_in_its_own() {
        let all =
            [series("a", 0, "s", &[1.0; 30]), series("a", 0, "t", &[-1.0, 1.0]), series("b", 0, "s", &[3.0])];
        let found = estimate(&all, true).expect("finite");
        assert_eq!((found.mean, found.subjects, found.seeds, found.frames), (1.75, 2, 1, 33));
        assert_eq!(found.win_rate, 32.0 / 33.0);
    }

    /// t over the means 1 and 3: 2 ± 12.706.
    #[test]
    fn several_subjects_are_a_t_interval_of_their_means() {
        let found =
            estimate(&[series("a", 0, "s", &[1.0]), series("b", 0, "s", &[2.0, 4.0])], true).expect("finite");
        let interval = found.interval.expect("two subjects");
        assert_eq!(interval.covers, Covers::Subjects);
        assert!(
            (interval.low - (2.0 - 12.7062)).abs() < 1e-4 && (interval.high - (2.0 + 12.7062)).abs() < 1e-4
        );
    }

    #[test]
    fn seeds_are_covered_from_three_on() {
        let values: Vec<f64> = (0..20).map(|i| portable::sin(f64::from(i * i))).collect();
        let seeds = |n: u64| -> Vec<Series> {
            let moved = |seed: u64| values.iter().map(|v| v + 10.0 * seed as f64).collect::<Vec<_>>();
            (0..n).map(|seed| series("a", seed, "s", &moved(seed))).collect()
        };
        let interval = |n| estimate(&seeds(n), true).expect("finite").interval.expect("enough frames");
        let (two, three) = (interval(2), interval(3));
        assert_eq!((two.covers, three.covers), (Covers::Frames, Covers::Seeds));
        assert!(two.high - two.low < 4.0, "{two:?}");
        // t over 0, 10 and 20 alone: 4.3027 * 10 / sqrt(3).
        assert!(three.high - three.low > 2.0 * 24.8, "{three:?}");
    }

    #[test]
    fn too_few_frames_have_no_interval() {
        let some = [0.3, -0.1, 0.4, 0.2, 0.1, 0.6, -0.3, 0.5];
        assert!(of_one(&some[..7]).interval.is_none());
        assert!(of_one(&some).interval.is_some());
        let two = |a: usize, b: usize| {
            let both = [series("a", 0, "s", &some[..a]), series("a", 0, "t", &some[..b])];
            estimate(&both, true).expect("finite").interval
        };
        assert!(two(4, 8).is_none() && two(8, 4).is_none());
        assert!(two(5, 5).is_some() && two(6, 5).is_some());
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let message = |series: &[Series]| estimate(series, true).unwrap_err().to_string();
        assert_eq!(message(&[]), "differences: none; expected at least one frame");
        assert_eq!(message(&[series("a", 0, "s", &[])]), message(&[]));
        for bad in [f64::NAN, f64::INFINITY] {
            let found = message(&[series("a", 7, "s", &[1.0, bad])]);
            assert!(found.starts_with("differences of a / s, seed 7: frame 1 is not finite"), "{found}");
        }
        let twice = message(&[series("a", 0, "s", &[1.0]), series("a", 0, "s", &[1.0])]);
        assert!(twice.contains("2 series"), "{twice}");
        let ragged = message(&[series("a", 0, "s", &[1.0]), series("a", 1, "s", &[1.0, 2.0])]);
        assert!(ragged.contains("2 frames where another seed has 1"), "{ragged}");
        let absent = message(&[series("a", 0, "s", &[1.0]), series("a", 1, "t", &[1.0])]);
        assert!(absent.contains("seed 1: 0 series"), "{absent}");
    }

    /// The same values in another order say more if neighbours are not alike.
    #[test]
    fn correlated_frames_widen_the_interval_and_count_for_less() {
        let smooth: Vec<f64> = (0..64).map(|i| portable::sin(f64::from(i) * 0.2)).collect();
        let mut shuffled = smooth.clone();
        let mut random = SplitMix64::new(1);
        (1..64).for_each(|i| shuffled.swap(i, random.below(i + 1)));
        let width = |found: &Estimate| found.interval.map(|i| i.high - i.low).expect("enough frames");
        let (smooth, shuffled) = (of_one(&smooth), of_one(&shuffled));
        assert!(width(&smooth) > 2.0 * width(&shuffled), "{} {}", width(&smooth), width(&shuffled));
        assert!(
            smooth.effective_frames < 10.0 && shuffled.effective_frames > 30.0,
            "{smooth:?} {shuffled:?}"
        );
    }

    proptest! {
        /// In another unit, moved, or with the sign turned, an interval is the same.
        #[test]
        fn intervals_follow_units(values in proptest::collection::vec(-5.0..5.0_f64, 8..40)) {
            let found = of_one(&values);
            let interval = found.interval.expect("enough frames");
            prop_assert!(interval.low <= found.mean && found.mean <= interval.high);
            prop_assert_eq!(of_one(&values), found);
            let other = of_one(&values.iter().map(|v| 7.0 - 1e-3 * v).collect::<Vec<_>>());
            let turned = other.interval.expect("enough frames");
            let width = interval.high - interval.low;
            prop_assert!((turned.low - (7.0 - 1e-3 * interval.high)).abs() < 1e-9 * (1.0 + width));
            prop_assert!((turned.high - (7.0 - 1e-3 * interval.low)).abs() < 1e-9 * (1.0 + width));
        }
    }
}
