//! Whether masks show the poses of other frames: all of them by a shift, some of them by one, or in another order.
//!
//! The body in the poses of the frames before and after is drawn under the frame's own camera, so cameras may move, and frames that
//! are left out of a sequence do not matter as long as their poses are known.

use super::bodies::{Bodies, Pair};
use super::findings::{Explained, mean};
use super::{Finding, Kind};
use skinsplat_data::Sequence;
use skinsplat_data::select::evenly_spaced;
use std::collections::{BTreeMap, BTreeSet};

/// Poses before and after a frame's own that are tried for every frame.
const NEAR: isize = 4;
/// Frames that are compared with their neighbours, at most.
const MOST: usize = 160;
/// Frames that are compared with all poses, and these poses, at most.
const LOOKED_UP: usize = 32;
const POSES: usize = 160;
/// By how much the overlap must be better for the pose of another frame.
const BETTER: f64 = 0.03;
/// By how much in the mean, if nearly every frame says so; and as a share of what is missing to a perfect overlap.
const SLIGHTLY: f64 = 0.01;
const OF_THE_REST: f64 = 0.12;
/// The same, where some frames or any pose may be chosen: poses of an estimator fit others a little better by chance.
const OF_THE_REST_CHOSEN: f64 = 1.0 / 3.0;
/// An overlap that leaves nothing to explain.
const PERFECT: f64 = 0.95;
/// Masks of one camera that overlap by more than this are of a person who stands still.
const STILL: f64 = 0.97;
/// Fewer frames decide nothing.
const FEWEST: usize = 4;

/// Frames, each with what it would gain by the poses of its neighbours.
pub(super) struct Neighbours<'a> {
    sequence: &'a Sequence,
    bodies: &'a Bodies<'a>,
    frames: Vec<Frame<'a>>,
}

struct Frame<'a> {
    pair: Pair<'a>,
    own: f64,
    /// By how many poses later, and what the overlap gains; without the frame's own.
    gains: BTreeMap<isize, f64>,
}

impl<'a> Neighbours<'a> {
    pub(super) fn new(sequence: &'a Sequence, bodies: &'a Bodies<'a>, pairs: &[Pair<'a>]) -> Self {
        let mut pairs = evenly_spaced(pairs, Some(MOST));
        // What a camera saw is in the order of time.
        pairs.sort_by_key(|(seen, _)| (bodies.camera_of(seen), seen.index));
        if pairs.iter().map(|(seen, _)| bodies.camera_of(seen)).collect::<BTreeSet<_>>().len() == pairs.len()
        {
            pairs.sort_by_key(|(seen, _)| seen.index);
        }
        let near = |i: usize| {
            let own = bodies.pose_of(pairs[i].0);
            let shifts = (-NEAR..=NEAR).filter(|&shift| shift != 0);
            shifts.filter_map(|s| own.checked_add_signed(s).filter(|&p| p < bodies.poses())).collect()
        };
        let overlaps = bodies.overlaps(&pairs, near);
        let frame = |(&pair, near): (&Pair<'a>, BTreeMap<usize, f64>)| {
            let own_pose = bodies.pose_of(pair.0) as isize;
            let own = pair.1.body.overlap(&pair.1.mask)?;
            let gains = near.into_iter().map(|(pose, overlap)| (pose as isize - own_pose, overlap - own));
            Some(Frame { pair, own, gains: gains.collect() })
        };
        let frames = match stands_still(bodies, &pairs) {
            true => Vec::new(),
            false => pairs.iter().zip(overlaps).filter_map(frame).collect(),
        };
        Self { sequence, bodies, frames }
    }

    /// All frames fit the poses of frames before or after them.
    fn shifted(&self) -> Option<Explained> {
        let shifts = (-NEAR..=NEAR).filter(|&shift| shift != 0);
        let (shift, gains) = shifts
            .map(|shift| (shift, self.frames.iter().filter_map(|f| f.gains.get(&shift).copied()).collect()))
            .filter(|(_, gains): &(isize, Vec<f64>)| 2 * gains.len() > self.frames.len())
            .max_by(|a, b| average(&a.1).total_cmp(&average(&b.1)))?;
        let own = mean(self.frames.iter().map(|frame| frame.own))?;
        // Poses that are further away may fit better still: that is for the search among all of them.
        if !consistent(&gains, own) || shift.abs() == NEAR {
            return None;
        }
        let first = self.frames.iter().find(|frame| frame.gains.contains_key(&shift))?;
        let gain = average(&gains);
        let detail = format!(
            "poses are {} (overlap {:.2} for {own:.2}): {}",
            late(shift),
            own + gain,
            self.which(first, shift)
        );
        Some(Explained { gain, finding: self.finding(detail, true) })
    }

    /// All frames, or some, fit poses of other frames: the simplest change of those that explain as much.
    pub(super) fn explained(&self) -> Option<Explained> {
        let changes = [self.shifted(), self.shifted_in_part(), self.disordered()];
        let most = changes.iter().flatten().map(|change| change.gain).max_by(f64::total_cmp)?;
        changes.into_iter().flatten().find(|change| change.gain > most - BETTER)
    }

    /// Frames one after the other, of one camera, that fit the poses of frames before or after them.
    fn shifted_in_part(&self) -> Option<Explained> {
        let group = |frame: &Frame<'_>| self.bodies.camera_of(frame.pair.0);
        let alone = self.frames.iter().map(group).collect::<BTreeSet<_>>().len() == self.frames.len();
        let runs = self.frames.chunk_by(|a, b| alone || group(a) == group(b));
        let candidates = runs.flat_map(|run| {
            let shifts = (1 - NEAR..NEAR).filter(|&shift| shift != 0);
            shifts.filter_map(move |shift| Some((shift, best_part(run, shift)?)))
        });
        let sum = |(shift, part): &(isize, &[Frame<'_>])| -> f64 {
            part.iter().filter_map(|frame| frame.gains.get(shift)).sum()
        };
        let (shift, part) = candidates.max_by(|a, b| sum(a).total_cmp(&sum(b)))?;
        let own = mean(part.iter().map(|frame| frame.own))?;
        let gains: Vec<f64> = part.iter().filter_map(|frame| frame.gains.get(&shift).copied()).collect();
        let [first, .., last] = part else { return None };
        if gains.len() < FEWEST || !consistent(&gains, own) || by_chance(average(&gains), own) {
            return None;
        }
        let gain = gains.iter().sum::<f64>() / self.frames.len() as f64;
        let detail = format!(
            "poses are {} from {} to {} (overlap {:.2} for {own:.2}): {}",
            late(shift),
            self.name(first),
            self.name(last),
            own + average(&gains),
            self.which(first, shift)
        );
        Some(Explained { gain, finding: self.finding(detail, true) })
    }

    /// Single frames that fit another pose much better than frames do that fit their own.
    pub(super) fn strangers(&self) -> Option<Finding> {
        let best =
            |frame: &Frame<'_>| frame.gains.iter().map(|(&s, &g)| (s, g)).max_by(|a, b| a.1.total_cmp(&b.1));
        let best: Vec<(&Frame<'_>, (isize, f64))> =
            self.frames.iter().filter_map(|frame| Some((frame, best(frame)?))).collect();
        if best.len() < FEWEST {
            return None;
        }
        let gains: Vec<f64> = best.iter().map(|(_, (_, gain))| *gain).collect();
        let limit = outlying(&gains, 0.02);
        let odd: Vec<_> =
            best.iter().filter(|(frame, (_, gain))| *gain > limit && !by_chance(*gain, frame.own)).collect();
        let (frame, (shift, gain)) = odd.first()?;
        let detail = format!(
            "{} of {} frames fit the pose of another ({} first, overlap {:.2} for {:.2}): {}",
            odd.len(),
            self.frames.len(),
            self.name(frame),
            frame.own + gain,
            frame.own,
            self.which(frame, *shift)
        );
        Some(self.finding(detail, 20 * odd.len() > self.frames.len()))
    }

    /// Masks that fit poses far away, or in another order.
    fn disordered(&self) -> Option<Explained> {
        let own = mean(self.frames.iter().map(|frame| frame.own))?;
        let looked_up = evenly_spaced(&(0..self.frames.len()).collect::<Vec<_>>(), Some(LOOKED_UP));
        if own >= PERFECT {
            return None;
        }
        let used: BTreeSet<usize> = self.frames.iter().map(|f| self.bodies.pose_of(f.pair.0)).collect();
        let all: Vec<usize> = match self.bodies.poses() <= POSES {
            true => (0..self.bodies.poses()).collect(),
            false => evenly_spaced(&used.into_iter().collect::<Vec<_>>(), Some(POSES)),
        };
        let pairs: Vec<Pair<'a>> = looked_up.iter().map(|&i| self.frames[i].pair).collect();
        let overlaps = self.bodies.overlaps(&pairs, |_| all.clone());
        let best = |(pair, overlaps): (&Pair<'a>, BTreeMap<usize, f64>)| {
            let own = pair.1.body.overlap(&pair.1.mask)?;
            let (pose, best) = overlaps.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
            Some(Match { pair: *pair, own, pose, gain: (best - own).max(0.0) })
        };
        let matches: Vec<Match<'a>> = pairs.iter().zip(overlaps).filter_map(best).collect();
        self.order(&matches)
    }

    fn order(&self, matches: &[Match<'_>]) -> Option<Explained> {
        let n = matches.len();
        let moved: Vec<&Match<'_>> = matches.iter().filter(|m| m.gain > BETTER).collect();
        let distinct = moved.iter().map(|m| m.pose).collect::<BTreeSet<_>>().len();
        let own = mean(matches.iter().map(|m| m.own))?;
        let gain = mean(matches.iter().map(|m| m.gain))?;
        // Poses that are merely wrong fit others by chance, and many of them the same one.
        if n < FEWEST && !evident(gain, own)
            || gain < BETTER
            || by_chance(gain, own)
            || 10 * moved.len() < 3 * n
            || 10 * distinct < 6 * moved.len()
        {
            return None;
        }
        let away = |m: &&Match<'_>| m.pose as isize - self.bodies.pose_of(m.pair.0) as isize;
        let mut shifts: Vec<isize> = moved.iter().map(away).collect();
        shifts.sort_unstable();
        let shift = shifts[shifts.len() / 2];
        let alike = shifts.iter().filter(|s| (*s - shift).abs() <= 1 + shift.abs() / 10).count();
        let how = match shift != 0 && 10 * alike >= 6 * moved.len() {
            true => format!("poses are about {}", late(shift)),
            false => format!("{} of {n} frames fit the poses of others, in another order", moved.len()),
        };
        let first = moved[0];
        let detail = format!(
            "{how} (overlap {:.2} for {own:.2}): {} has the pose of {}",
            own + gain,
            self.sequence.frames[first.pair.0.index].name,
            self.bodies.name_of_pose(first.pose)
        );
        Some(Explained { gain, finding: self.finding(detail, true) })
    }

    fn finding(&self, detail: String, spoils: bool) -> Finding {
        Finding { spoils, ..Finding::new(Kind::FrameOffset, &self.sequence.id, detail) }
    }

    fn name(&self, frame: &Frame<'_>) -> &str {
        &self.sequence.frames[frame.pair.0.index].name
    }

    fn which(&self, frame: &Frame<'_>, shift: isize) -> String {
        let pose = self.bodies.pose_of(frame.pair.0).saturating_add_signed(shift);
        format!("{} has the pose of {}", self.name(frame), self.bodies.name_of_pose(pose))
    }
}

/// True if masks that a camera saw one after the other tell no order.
fn stands_still(bodies: &Bodies<'_>, pairs: &[Pair<'_>]) -> bool {
    let neighbours =
        pairs.windows(2).filter(|pair| bodies.camera_of(pair[0].0) == bodies.camera_of(pair[1].0));
    mean(neighbours.filter_map(|pair| pair[0].1.mask.overlap(&pair[1].1.mask)))
        .is_some_and(|same| same > STILL)
}

/// A mask and the pose that fits it best.
struct Match<'a> {
    pair: Pair<'a>,
    own: f64,
    pose: usize,
    /// What the overlap gains by it.
    gain: f64,
}

/// "2 frames late": the pose that belongs to a frame is that of the second frame after it.
fn late(shift: isize) -> String {
    let count = shift.unsigned_abs();
    format!("{count} frame{} {}", if count == 1 { "" } else { "s" }, if shift > 0 { "late" } else { "early" })
}

/// The frames one after the other that gain most by a shift, if they are some but not all.
fn best_part<'f, 'a>(run: &'f [Frame<'a>], shift: isize) -> Option<&'f [Frame<'a>]> {
    let gain = |frame: &Frame<'_>| frame.gains.get(&shift).map_or(0.0, |gain| gain - SLIGHTLY);
    let (mut best, mut sum, mut start) = ((0.0, 0..0), 0.0, 0);
    for (end, frame) in run.iter().enumerate() {
        if sum <= 0.0 {
            (sum, start) = (0.0, end);
        }
        sum += gain(frame);
        if sum > best.0 {
            best = (sum, start..end + 1);
        }
    }
    let part = &run[best.1];
    (part.len() >= FEWEST.max(run.len() / 10)).then_some(part)
}

fn average(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// True if so much may be gained from an overlap of `own` by the best of many poses, or for the best of many frames.
fn by_chance(gain: f64, own: f64) -> bool {
    gain < OF_THE_REST_CHOSEN * (1.0 - own)
}

/// True if so much better an overlap needs no further frames to be believed.
fn evident(gain: f64, own: f64) -> bool {
    gain > 0.15 && own + gain > 0.85
}

/// True if gains are large, or small but nearly all of one sign and far from zero for their spread; `own` is the overlap that
/// they are added to.
fn consistent(gains: &[f64], own: f64) -> bool {
    let n = gains.len();
    let gain = average(gains);
    let positive = gains.iter().filter(|gain| **gain > 0.0).count();
    if n < FEWEST {
        return n > 1 && positive == n && evident(gain, own);
    }
    if gain < SLIGHTLY.max(OF_THE_REST * (1.0 - own)) {
        return false;
    }
    let variance = gains.iter().map(|g| (g - gain) * (g - gain)).sum::<f64>() / (n - 1) as f64;
    let sure = n >= 6 && 10 * positive >= 8 * n && gain > 4.0 * (variance / n as f64).sqrt();
    sure || (gain > BETTER && 10 * positive >= 6 * n)
}

/// A value above which one of these is no part of what the others are: six times their median distance from their median above it,
/// and not below `least`.
fn outlying(values: &[f64], least: f64) -> f64 {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let middle = median(values.to_vec());
    let spread = median(values.iter().map(|value| (value - middle).abs()).collect());
    (middle + 6.0 * spread).max(least)
}
