//! The training frames of an optimiser: in a seeded order, decoded when first asked for, held while memory allows.

use crate::Error;
use crate::frame_order::shuffled;
use skinsplat_core::scene::{Camera, Pose, PosedBody};
use skinsplat_data::sequence::{Sequence, Truth};

/// Decoded frames are held up to this many bytes; the others are decoded again when their turn comes.
const HELD_BYTES: usize = 512 << 20;

/// One frame, ready to be compared with.
pub(super) struct TrainingFrame<'f> {
    pub(super) name: &'f str,
    pub(super) camera: &'f Camera,
    pub(super) pose: &'f Pose,
    /// Which of the sequence's poses it is.
    pub(super) pose_index: usize,
    pub(super) truth: &'f Truth,
}

/// The frames of a sequence.
pub(super) struct TrainingFrames<'a> {
    sequence: &'a Sequence,
    seed: u64,
    /// Per frame: what is known of it.
    slots: Vec<Slot>,
    /// The frame that did not fit into memory.
    loose: Option<Truth>,
    held: usize,
    epoch: Option<(usize, Vec<usize>)>,
}

enum Slot {
    Unknown,
    /// Looked at, and nothing can be learnt from it.
    Useless,
    /// Looked at, but there was no room.
    Known,
    Held(Truth),
}

impl<'a> TrainingFrames<'a> {
    pub(super) fn new(sequence: &'a Sequence, seed: u64) -> Self {
        let slots = sequence.frames.iter().map(|_| Slot::Unknown).collect();
        Self { sequence, seed, slots, loose: None, held: 0, epoch: None }
    }

    /// The frame of an iteration: every frame once per epoch, in another order each time. Frames from which nothing can be
    /// learnt are passed over with a warning.
    ///
    /// # Errors
    /// A frame that cannot be read; none of the frames shows the body.
    pub(super) fn of_iteration(
        &mut self,
        iteration: usize,
        warnings: &mut Vec<String>,
    ) -> Result<TrainingFrame<'_>, Error> {
        let n = self.slots.len();
        let first = self.place(iteration);
        let mut index = first;
        for attempt in 1..=n {
            if let Some(problem) = self.load(index)? {
                warnings.push(problem);
            }
            if !matches!(self.slots[index], Slot::Useless) {
                break;
            }
            if attempt == n {
                let field = format!("sequence {}: frames", self.sequence.id);
                let expected = "at least one frame in which the mask and the posed body overlap";
                return Err(Error::invalid(field, format!("none of {n} can be used"), expected));
            }
            index = (index + 1) % n;
        }
        let frame = &self.sequence.frames[index];
        let truth = match &self.slots[index] {
            Slot::Held(truth) => truth,
            _ => self.loose.as_ref().expect("a frame that is not held was just decoded"),
        };
        Ok(TrainingFrame {
            name: &frame.name,
            camera: &self.sequence.cameras[frame.camera],
            pose: &self.sequence.poses[frame.pose],
            pose_index: frame.pose,
            truth,
        })
    }

    fn place(&mut self, iteration: usize) -> usize {
        let n = self.slots.len();
        let (epoch, place) = (iteration / n, iteration % n);
        if self.epoch.as_ref().is_none_or(|(known, _)| *known != epoch) {
            self.epoch = Some((epoch, shuffled(n, self.seed, epoch as u64)));
        }
        self.epoch.as_ref().map_or(0, |(_, order)| order[place])
    }

    /// Makes a frame ready. The first look may find it useless, which is said once.
    fn load(&mut self, index: usize) -> Result<Option<String>, Error> {
        let unknown = matches!(self.slots[index], Slot::Unknown);
        if !unknown && !matches!(self.slots[index], Slot::Known) {
            return Ok(None);
        }
        let truth = self.sequence.truth(index)?;
        if unknown && let Some(problem) = self.problem(index, &truth)? {
            self.slots[index] = Slot::Useless;
            let name = &self.sequence.frames[index].name;
            return Ok(Some(format!("{}: frame {name} is not used: {problem}", self.sequence.id)));
        }
        let bytes = truth.alpha.values().len() * size_of::<[f32; 4]>();
        if self.held + bytes <= HELD_BYTES {
            self.held += bytes;
            self.slots[index] = Slot::Held(truth);
        } else {
            self.slots[index] = Slot::Known;
            self.loose = Some(truth);
        }
        Ok(None)
    }

    /// Why nothing can be learnt from a frame.
    fn problem(&self, index: usize, truth: &Truth) -> Result<Option<String>, Error> {
        let mask = &truth.alpha;
        if mask.values().iter().all(|&a| a <= 0.0) {
            return Ok(Some("its mask is empty".to_owned()));
        }
        let frame = &self.sequence.frames[index];
        let camera = &self.sequence.cameras[frame.camera];
        let body = PosedBody::new(&self.sequence.body, &self.sequence.poses[frame.pose])
            .map_err(Error::scene(self.sequence))?;
        let (mut inside, mut covered) = (false, false);
        for vertex in &body.mesh().vertices {
            let Some((pixel, _)) = camera.project(vertex.as_dvec3()) else { continue };
            let (x, y) = (pixel.x.floor(), pixel.y.floor());
            if x >= 0.0 && y >= 0.0 && x < mask.width() as f64 && y < mask.height() as f64 {
                inside = true;
                covered |= mask.at(x as usize, y as usize) > 0.0;
            }
        }
        Ok(match (inside, covered) {
            (false, _) => Some("the body lies outside the image".to_owned()),
            (true, false) => Some("its mask misses the body".to_owned()),
            (true, true) => None,
        })
    }
}
