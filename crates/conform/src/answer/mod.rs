//! An engine's answer: posed PLY files, JSON or flat binary.

mod binary;
mod json;
mod layout;
mod ply;

pub(crate) use binary::{BLOCK, Block, HEADER, MAGIC, VERSION, dtype};

use super::convention::{Convention, QuaternionOrder};
use super::rig::Rig;
use super::sample::{Field, Fields, Sample, Storage, range};
use super::{Error, half_floats, rig};
use std::path::Path;

/// What an engine made of the rig.
#[derive(Clone, Debug)]
pub struct Answer {
    /// How scales and opacities are stored.
    pub storage: Storage,
    /// The poses that are answered; `None` for a single one that does not say which it is.
    pub frames: Option<Vec<usize>>,
    /// Which of the fields are given.
    pub(crate) present: Fields,
    /// Pose after pose, Gaussian after Gaussian. Numbers of absent fields are 0.
    pub(crate) samples: Vec<Sample>,
    /// Fields whose every number a half float holds.
    pub(crate) halves: Fields,
    /// The convention that the file itself declares, if it does.
    pub(crate) declared: Option<Declared>,
    /// What has to be said of how it was read, a clause each.
    pub notes: Vec<String>,
}

/// A convention as a file declares it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Declared {
    pub(crate) name: String,
    pub(crate) quaternions: Option<QuaternionOrder>,
}

/// What the rig expects of an answer, for readers.
pub(crate) struct Expected {
    pub(crate) gaussians: usize,
    pub(crate) poses: usize,
    /// Which pose the answer is said to be of, outside of it.
    pub(crate) frame: Option<usize>,
}

impl Expected {
    fn of(rig: &Rig, frame: Option<usize>) -> Self {
        Self { gaussians: rig.len(), poses: rig.poses.len(), frame }
    }

    /// The poses of an answer of so many, some of which says which.
    ///
    /// # Errors
    /// What was said outside of it contradicts.
    fn poses_of(&self, said: Option<Vec<usize>>, poses: usize) -> Result<Option<Vec<usize>>, Error> {
        let contradicted = |expected: String| match self.frame {
            Some(frame) => Err(Error::new("--frame", format!("{frame}"), expected)),
            None => Ok(()),
        };
        let said = said.or_else(|| (poses == self.poses).then(|| (0..poses).collect()));
        match (&said, self.frame) {
            (Some(said), Some(frame)) if said.len() > 1 || said.first() != Some(&frame) => {
                let list: Vec<String> = said.iter().map(usize::to_string).collect();
                contradicted(format!("what the answer says itself, pose(s) {}", list.join(", ")))?;
            }
            _ => {}
        }
        Ok(said.or(self.frame.map(|frame| vec![frame])))
    }
}

impl Answer {
    /// Reads an answer, told apart by content: a folder of PLY files or one of them, JSON, or flat binary. `frame` says which
    /// pose it is of, where it does not say so itself.
    ///
    /// # Errors
    /// Another format, another number of Gaussians or poses, NaN, half floats, no field at all.
    pub fn read(path: &Path, rig: &Rig, frame: Option<usize>) -> Result<Self, Error> {
        let expected = Expected::of(rig, frame);
        if let Some(frame) = frame.filter(|&frame| frame >= expected.poses) {
            let problem = format!("{frame}");
            return Err(Error::new("--frame", problem, format!("a pose below {}", expected.poses)));
        }
        let answer = if path.is_dir() {
            ply::folder(path, &expected)?
        } else {
            let what = "a posed PLY, a JSON answer or a flat binary answer (README.md of the rig says how)";
            let bytes = skinsplat_data::error::read_bytes(path, "answer", what)?;
            if bytes.starts_with(b"ply") {
                ply::single(path, &expected)?
            } else if bytes.starts_with(MAGIC) {
                binary::read(&bytes, &expected).map_err(|e| e.within(path))?
            } else if bytes.trim_ascii_start().first().is_some_and(|b| b"{[\xEF".contains(b)) {
                json::read(&bytes, &expected).map_err(|e| e.within(path))?
            } else if bytes.is_empty() {
                return Err(Error::new(format!("{}: answer", path.display()), "an empty file", what));
            } else {
                let start: String = bytes.iter().take(8).map(|b| format!("{b:02x}")).collect();
                let problem = format!("unknown format, {} bytes that begin with {start}", bytes.len());
                return Err(Error::new(format!("{}: answer", path.display()), problem, what));
            }
        };
        answer.checked(path)
    }

    fn checked(mut self, path: &Path) -> Result<Self, Error> {
        if self.present.is_empty() {
            let names = "means, quaternions, scales, covariances, directions, opacities or sh";
            return Err(Error::new(
                format!("{}: answer", path.display()),
                "no field of an answer",
                format!("at least one of {names}"),
            ));
        }
        let samples = &self.samples;
        let held =
            |field: &Field| samples.iter().all(|s| s[range(*field)].iter().all(|&v| half_floats::holds(v)));
        self.halves = self.present.iter().filter(held).collect();
        Ok(self)
    }

    /// The fields that are not given, by name, bands of SH together.
    pub(crate) fn absent(&self) -> Vec<&'static str> {
        Field::ALL.into_iter().filter(|&field| !self.present.contains(field)).map(Field::name).collect()
    }

    /// The convention that the answer is read in: what was asked for, or that of the folder.
    ///
    /// # Errors
    /// The file declares another.
    pub(crate) fn agrees_with(&self, convention: &Convention, path: &Path) -> Result<(), Error> {
        let Some(declared) = &self.declared else { return Ok(()) };
        let other_name = !declared.name.is_empty() && declared.name != convention.name;
        let other_order = declared.quaternions.is_some_and(|order| order != convention.quaternions);
        if !other_name && !other_order {
            return Ok(());
        }
        let order = declared.quaternions.map_or("", QuaternionOrder::name);
        let expected = format!(
            "{} with {}, as declared (--convention changes that)",
            convention.name,
            convention.quaternions.name()
        );
        let name: String = declared.name.chars().take(40).collect();
        let problem = match (name.as_str(), order) {
            ("", order) => format!("quaternions {order}"),
            (name, "") => name.to_owned(),
            (name, order) => format!("{name} with {order}"),
        };
        Err(Error::new(format!("{}: convention", path.display()), problem, expected))
    }
}

/// The samples of a number of poses, empty.
fn blank(poses: usize, gaussians: usize) -> Vec<Sample> {
    vec![[0.0; super::sample::WIDTH]; poses * gaussians]
}

/// Puts the numbers of a field into samples; `values` holds `width` of them per sample from `offset` in the field on.
fn put(samples: &mut [Sample], field: Field, values: &[f64]) {
    let width = field.width();
    for (sample, values) in samples.iter_mut().zip(values.chunks_exact(width)) {
        sample[range(field)].copy_from_slice(values);
    }
}

/// Refuses numbers that are not finite.
fn finite(name: &str, values: &[f64], per_pose: usize, width: usize) -> Result<(), Error> {
    let Some(at) = values.iter().position(|v| !v.is_finite()) else { return Ok(()) };
    let (pose, gaussian) = (at / (per_pose * width), at / width % per_pose);
    let place = format!("{name}[{pose}][{gaussian}]");
    Err(Error::new(place, format!("{}", values[at]), "finite numbers"))
}

pub(crate) use rig::RIG_VERSION;
