//! Poses as axis-angle vectors by part, and the joints that they become.

use super::FARTHEST;
use super::part::{Family, Part};
use crate::{Error, SourceDigest, Sourced, digest::Fingerprint};
use glam::DVec3;
use skinsplat_core::scene::{HandSpace, LocalTransform, Pose, Skeleton};
use std::path::Path;

/// What hand poses are relative to: `flat_hand_mean` of the smplx package.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hands {
    /// The flat hand: values are rotations as they are (AMASS, whole vectors).
    Flat,
    /// The mean hand of the body model, which is added to them (the default of the smplx package).
    Mean,
}

/// One part of all poses: rows of equal width.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Track {
    pub(super) part: Part,
    /// Values per frame.
    pub(super) width: usize,
    /// True for coefficients of principal components of a hand.
    pub(super) principal: bool,
    pub(super) values: Vec<f64>,
}

/// A motion by parts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Angles {
    /// [`Part::Whole`] alone, or other parts, each once.
    pub(super) tracks: Vec<Track>,
    /// Metres, one per frame.
    pub(super) translations: Vec<DVec3>,
    /// One per frame; empty if all are 1.
    pub(super) scales: Vec<f64>,
    /// As the file says, if it does.
    pub(super) hands: Option<Hands>,
}

/// Rotations of the first joints of a body, frame by frame, and what had to be done for them.
struct Placed {
    rotations: Vec<Vec<DVec3>>,
    notes: Vec<String>,
}

impl Track {
    pub(super) fn joints(&self) -> usize {
        self.width / 3
    }

    fn row(&self, frame: usize) -> &[f64] {
        &self.values[frame * self.width..][..self.width]
    }

    /// True if joint `k` and those after it are at rest in all frames.
    fn rests_from(&self, k: usize) -> bool {
        let rest = |row: &[f64]| row.iter().skip(3 * k).all(|&v| v == 0.0);
        self.values.chunks_exact(self.width.max(1)).all(rest)
    }

    /// The rows of both, one behind the other.
    pub(super) fn beside(&self, right: &Self) -> Vec<f64> {
        let rows =
            self.values.chunks_exact(self.width.max(1)).zip(right.values.chunks_exact(right.width.max(1)));
        rows.flat_map(|(left, right)| left.iter().chain(right).copied()).collect()
    }

    /// The joints from `first` on as a track of their own.
    fn cut(&self, part: Part, range: std::ops::Range<usize>) -> Self {
        let columns = 3 * range.start..3 * range.end;
        let rows = self.values.chunks_exact(self.width);
        let values = rows.flat_map(|row| row[columns.clone()].iter().copied()).collect();
        Self { part, width: columns.len(), principal: false, values }
    }
}

impl Angles {
    pub(super) fn len(&self) -> usize {
        self.translations.len()
    }

    pub(super) fn num_joints(&self) -> usize {
        self.tracks.iter().map(|t| if t.principal { 15 } else { t.joints() }).sum()
    }

    /// True if one array has all joints.
    pub(super) fn is_whole(&self) -> bool {
        self.tracks.iter().any(|track| track.part == Part::Whole)
    }

    /// The parts, also those of one array of all joints in an order that is known.
    pub(super) fn parts(&self) -> Vec<Track> {
        self.tracks.iter().flat_map(|t| t.split().unwrap_or_else(|| vec![t.clone()])).collect()
    }

    /// Adds the frames of another motion; false if it has other parts.
    pub(super) fn append(&mut self, next: Self) -> bool {
        let same = |(own, next): (&Track, &Track)| {
            own.part == next.part && own.width == next.width && own.principal == next.principal
        };
        if self.tracks.len() != next.tracks.len() || !self.tracks.iter().zip(&next.tracks).all(same) {
            return false;
        }
        if !(self.scales.is_empty() && next.scales.is_empty()) {
            self.scales.resize(self.len(), 1.0);
            self.scales.extend(next.scales.iter().copied().chain(std::iter::repeat(1.0)).take(next.len()));
        }
        self.tracks.iter_mut().zip(next.tracks).for_each(|(own, next)| own.values.extend(next.values));
        self.translations.extend(next.translations);
        true
    }

    /// The poses for a skeleton, and the digest of the numbers behind them.
    pub(super) fn poses(&self, path: &Path, skeleton: &Skeleton) -> Result<Sourced<Vec<Pose>>, Error> {
        self.fit_into_memory(path, skeleton)?;
        let Placed { rotations, .. } = self.placed(path, skeleton)?;
        for (frame, own) in rotations.iter().enumerate() {
            if let Some(angle) = own.iter().find(|axis| axis.abs().max_element() > FARTHEST) {
                let problem = format!("an angle of {:e}", angle.abs().max_element());
                let expected = format!("radians, at most {FARTHEST:e}");
                return Err(Error::invalid(path, format!("poses[{frame}]"), problem, expected));
            }
        }
        let pose = |(frame, own): (usize, &Vec<DVec3>)| {
            let mut pose = Pose::from_axis_angles(skeleton, own, self.translations[frame]);
            if let Some(&scale) = self.scales.get(frame) {
                scale_body(&mut pose, skeleton, scale);
            }
            pose
        };
        let poses = rotations.iter().enumerate().map(pose).collect();
        Ok(Sourced::computed(poses, self.digest(&rotations)))
    }

    /// Refuses more poses than a file of its length should become: zeros compress a thousandfold.
    fn fit_into_memory(&self, path: &Path, skeleton: &Skeleton) -> Result<(), Error> {
        /// What a joint of a pose takes on its way, bytes.
        const JOINT: u64 = (size_of::<LocalTransform>() + 2 * size_of::<DVec3>()) as u64;
        let bytes = (self.len() * skeleton.num_joints()) as u64 * JOINT;
        let length =
            path.metadata().map_or(u64::MAX, |file| if file.is_file() { file.len() } else { u64::MAX });
        let most = length.saturating_mul(1032).saturating_add(1 << 26);
        if bytes <= most {
            return Ok(());
        }
        let problem = format!("{} of {} joints, {bytes} bytes in memory", self.len(), skeleton.num_joints());
        Err(Error::invalid(path, "poses", problem, format!("at most {most} bytes of a file of its length")))
    }

    /// What a skeleton makes of the parts that has to be said.
    pub(super) fn notes_for(&self, path: &Path, skeleton: &Skeleton) -> Vec<String> {
        self.placed(path, skeleton).map(|placed| placed.notes).unwrap_or_default()
    }

    /// The digest of rotations, translations and scales. Scales of 1 do not count.
    fn digest(&self, rotations: &[Vec<DVec3>]) -> SourceDigest {
        let mut hash = Fingerprint::new();
        hash.count(rotations.len());
        rotations.iter().for_each(|frame| hash.vectors(frame));
        hash.vectors(&self.translations);
        if !self.scales.is_empty() {
            hash.count(self.scales.len()).numbers(self.scales.iter().copied());
        }
        hash.finish()
    }

    fn placed(&self, path: &Path, skeleton: &Skeleton) -> Result<Placed, Error> {
        let joints = skeleton.num_joints();
        let whole = self.tracks.iter().find(|track| track.part == Part::Whole);
        let family = Family::of(joints);
        match (family, whole) {
            (Some(family), None) => self.by_family(path, skeleton, family, &self.tracks, Hands::Mean),
            (Some(family), Some(whole)) => match whole.split() {
                Some(parts) => self.by_family(path, skeleton, family, &parts, Hands::Flat),
                None => in_order(path, &[whole], joints, self.len()),
            },
            (None, Some(whole)) => in_order(path, &[whole], joints, self.len()),
            (None, None) => {
                let only = |part: Part| self.tracks.iter().filter(move |track| track.part == part);
                let ordered: Vec<&Track> = only(Part::GlobalOrient).chain(only(Part::BodyPose)).collect();
                if let Some(other) =
                    self.tracks.iter().find(|track| !ordered.iter().any(|t| t.part == track.part))
                {
                    let problem = format!("for a body of {joints} joints");
                    let expected =
                        "one of 24, 52 or 55 joints (SMPL, SMPL-H, SMPL-X), where parts have a place";
                    return Err(Error::invalid(path, other.part.name(), problem, expected));
                }
                in_order(path, &ordered, joints, self.len())
            }
        }
    }

    /// Every part at the joints that it has in the family; the others rest.
    fn by_family(
        &self,
        path: &Path,
        skeleton: &Skeleton,
        family: Family,
        tracks: &[Track],
        default: Hands,
    ) -> Result<Placed, Error> {
        let end = last_joint(family, tracks, skeleton);
        let mut placed = Placed { rotations: vec![vec![DVec3::ZERO; end]; self.len()], notes: Vec::new() };
        let mut without_place = Vec::new();
        for track in tracks {
            let place = family.place(track.part);
            if place.is_empty() {
                if !track.rests_from(0) {
                    without_place.push(track.part.name());
                }
                continue;
            }
            let rows = track.angles(path, skeleton)?;
            let width = rows.width / 3;
            if width > place.len() && !rows.rests_from(place.len()) {
                let left = width - place.len();
                placed.notes.push(format!(
                    "{}: its last {left} joints are not joints of the body and left out",
                    track.part
                ));
            }
            for (frame, rotations) in placed.rotations.iter_mut().enumerate() {
                let vectors = rows.row(frame).chunks_exact(3).map(DVec3::from_slice);
                rotations
                    .iter_mut()
                    .skip(place.start)
                    .take(place.len())
                    .zip(vectors)
                    .for_each(|(joint, own)| *joint = own);
            }
        }
        if !without_place.is_empty() {
            let joints = skeleton.num_joints();
            placed.notes.push(format!(
                "{}: a body of {joints} joints has none for it; left out",
                without_place.join(", ")
            ));
        }
        self.add_hand_means(skeleton, family, default, &mut placed);
        Ok(placed)
    }

    /// Adds the mean hands of the model, where hands are relative to them.
    fn add_hand_means(&self, skeleton: &Skeleton, family: Family, default: Hands, placed: &mut Placed) {
        let Some(hands) = skeleton.hands.as_deref() else { return };
        let sides = [(Part::LeftHand, &hands.left), (Part::RightHand, &hands.right)];
        let bent = |(part, hand): &(Part, &HandSpace)| {
            let place = family.place(*part);
            !place.is_empty() && hand.mean.len() == 3 * place.len() && !hand.is_flat()
        };
        let sides: Vec<_> = sides.into_iter().filter(bent).collect();
        if sides.is_empty() {
            return;
        }
        match (self.hands, default) {
            (None, Hands::Mean) => placed.notes.push(
                "hands: the body model's mean hands are added, as smplx does unless flat_hand_mean is set; assumed".into(),
            ),
            (None, Hands::Flat) => placed.notes.push(
                "hands: taken as they are, without the body model's mean hands (flat_hand_mean); assumed".into(),
            ),
            (Some(_), _) => {}
        }
        if self.hands.unwrap_or(default) == Hands::Flat {
            return;
        }
        for (part, hand) in sides {
            let place = family.place(part);
            for rotations in &mut placed.rotations {
                let means = hand.mean.chunks_exact(3).map(DVec3::from_slice);
                rotations[place.clone()].iter_mut().zip(means).for_each(|(joint, mean)| *joint += mean);
            }
        }
    }
}

/// Where the rotations of a frame end: with the last part that has a place, so that what a file does not mention stays out
/// of the digest.
fn last_joint(family: Family, tracks: &[Track], skeleton: &Skeleton) -> usize {
    let end = |track: &Track| {
        let place = family.place(track.part);
        if track.part == Part::BodyPose { place.end.min(place.start + track.joints()) } else { place.end }
    };
    let last = tracks.iter().map(end).max().unwrap_or(0);
    let bent = skeleton.hands.as_deref().is_some_and(|hands| !hands.left.is_flat() || !hands.right.is_flat());
    if bent { last.max(family.place(Part::RightHand).end) } else { last }
}

impl Track {
    /// The values as axis-angle vectors.
    fn angles(&self, path: &Path, skeleton: &Skeleton) -> Result<std::borrow::Cow<'_, Self>, Error> {
        if !self.principal {
            return Ok(std::borrow::Cow::Borrowed(self));
        }
        let hands = skeleton.hands.as_deref();
        let hand = hands.map(|hands| if self.part == Part::LeftHand { &hands.left } else { &hands.right });
        let found = hand.map_or(0, |hand| hand.components.len());
        let pose = |row: &[f64]| hand.and_then(|hand| hand.pose_of(row)).filter(|pose| pose.len() == 45);
        let rows: Option<Vec<Vec<f64>>> = self.values.chunks_exact(self.width).map(pose).collect();
        let rows = rows.ok_or_else(|| {
            let problem =
                format!("{} principal coefficients for a body model with {found} components", self.width);
            let expected = "a model with hands_componentsl and hands_componentsr, or 45 values per frame";
            Error::invalid(path, self.part.name(), problem, expected)
        })?;
        Ok(std::borrow::Cow::Owned(Self {
            part: self.part,
            width: 45,
            principal: false,
            values: rows.concat(),
        }))
    }

    /// The parts of a whole vector as SMPL, SMPL-H or SMPL-X order it; `None` if it is none of them.
    fn split(&self) -> Option<Vec<Self>> {
        let parts: &[(Part, std::ops::Range<usize>)] = match self.joints() {
            22 => &[(Part::GlobalOrient, 0..1), (Part::BodyPose, 1..22)],
            24 => &[(Part::GlobalOrient, 0..1), (Part::BodyPose, 1..24)],
            52 => &[
                (Part::GlobalOrient, 0..1),
                (Part::BodyPose, 1..22),
                (Part::LeftHand, 22..37),
                (Part::RightHand, 37..52),
            ],
            55 => &[
                (Part::GlobalOrient, 0..1),
                (Part::BodyPose, 1..22),
                (Part::Jaw, 22..23),
                (Part::LeftEye, 23..24),
                (Part::RightEye, 24..25),
                (Part::LeftHand, 25..40),
                (Part::RightHand, 40..55),
            ],
            _ => return None,
        };
        Some(parts.iter().map(|(part, range)| self.cut(*part, range.clone())).collect())
    }
}

/// Tracks one after the other, from the root on.
fn in_order(path: &Path, tracks: &[&Track], joints: usize, frames: usize) -> Result<Placed, Error> {
    let count: usize = tracks.iter().map(|track| track.joints()).sum();
    if count > joints {
        let field = tracks.last().map_or("thetas", |track| track.part.name());
        let expected = format!("at most the body's {joints} joints");
        return Err(Error::invalid(path, field, format!("{count} joints"), expected));
    }
    let vectors = |frame: usize| {
        let rows = tracks.iter().flat_map(move |track| track.row(frame).chunks_exact(3));
        rows.map(DVec3::from_slice).collect()
    };
    Ok(Placed { rotations: (0..frames).map(vectors).collect(), notes: Vec::new() })
}

/// `scale * LBS(pose)`: the roots carry the scale. The translation of the body is added after it.
fn scale_body(pose: &mut Pose, skeleton: &Skeleton, scale: f64) {
    for (local, _) in pose.locals.iter_mut().zip(&skeleton.parents).filter(|(_, parent)| parent.is_none()) {
        local.translation *= scale;
        local.scale *= scale;
    }
}
