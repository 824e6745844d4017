//! The body models of a subject: which file it is, loaded once, and the shapes of it that sequences share.

use super::folder::{Options, Subject};
use super::poses::PoseTrack;
use super::{Error, body, listing, npy};
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::{Body, RestBody};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// No clothing is farther from the body, metres.
const THICKEST: f64 = 0.5;
/// Shapes are estimated in at least so many directions.
const FEWEST_BETAS: usize = 10;

/// Which of the bodies of a family a subject has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gender {
    /// The female template.
    Female,
    /// The male template.
    Male,
    /// The template of both.
    Neutral,
}

/// The families of bodies that data sets name without naming a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    /// 24 joints.
    Smpl,
    /// 55 joints: with jaw, eyes and fingers.
    Smplx,
}

impl Gender {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Female, Self::Male, Self::Neutral];

    /// The gender of this name, in any case.
    pub(crate) fn named(name: &str) -> Option<Self> {
        match name.trim().to_ascii_lowercase().as_str() {
            "female" | "f" => Some(Self::Female),
            "male" | "m" => Some(Self::Male),
            "neutral" | "n" => Some(Self::Neutral),
            _ => None,
        }
    }

    /// The gender that a folder's name tells ("female-3-casual").
    pub(crate) fn in_name(name: &str) -> Option<Self> {
        let words = name.split(|c: char| !c.is_ascii_alphabetic());
        words.filter(|word| word.len() > 1).find_map(Self::named)
    }

    /// What it is called, in one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Female => "female",
            Self::Male => "male",
            Self::Neutral => "neutral",
        }
    }
}

impl Family {
    /// File names without extension, as the models are distributed.
    fn file_stems(self, gender: Gender) -> Vec<String> {
        let word = gender.name();
        let upper = word.to_ascii_uppercase();
        match self {
            Self::Smplx => vec![format!("SMPLX_{upper}")],
            Self::Smpl => {
                let letter = if gender == Gender::Neutral { word } else { &word[..1] };
                let original = |name: &str, version: &str| format!("{name}_{letter}_lbs_10_207_0_{version}");
                vec![
                    format!("SMPL_{upper}"),
                    original("basicModel", "v1.0.0"),
                    original("basicmodel", "v1.0.0"),
                    original("basicmodel", "v1.1.0"),
                ]
            }
        }
    }
}

/// How many shape coefficients a subject's files have for how many directions of its body model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShapeFit {
    /// The file with the coefficients.
    pub file: PathBuf,
    /// Coefficients up to the last that is not zero.
    pub betas: usize,
    /// Directions of the model: further coefficients are left out.
    pub directions: usize,
}

/// Something that a subject's own files say and that may spoil its numbers. It is among the subject's notes, too.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Doubt {
    /// What it is about.
    pub about: Doubtful,
    /// The note.
    pub note: String,
}

/// What a [`Doubt`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubtful {
    /// A lens that distorts, or a principal point that was moved.
    Camera,
    /// A body of another gender than the subject's.
    Gender,
    /// Fewer shape coefficients than any body has.
    Betas,
}

/// Body models that were loaded for a subject, and the shapes of them that its sequences share.
pub(crate) struct Models<'a> {
    subject: &'a Path,
    options: &'a Options,
    loaded: BTreeMap<PathBuf, Model>,
    notes: Vec<String>,
    doubts: Vec<Doubt>,
    shapes: Vec<ShapeFit>,
}

struct Model {
    body: Body,
    /// By betas and expression.
    shapes: Vec<([Vec<f64>; 2], Arc<RestBody>)>,
}

impl<'a> Models<'a> {
    pub(crate) fn new(subject: &'a Path, options: &'a Options) -> Self {
        Self {
            subject,
            options,
            loaded: BTreeMap::new(),
            notes: Vec::new(),
            doubts: Vec::new(),
            shapes: Vec::new(),
        }
    }

    /// What has to be said of the models and of the shapes that were asked for, each once and with its file.
    pub(crate) fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The subject with what is known of its models: shapes that were asked for, each once, and doubts.
    pub(crate) fn told(self, mut subject: Subject) -> Subject {
        subject.shapes.extend(self.shapes);
        subject.doubts.extend(self.doubts);
        subject
    }

    /// Adds what has to be said of a file and may spoil numbers.
    fn doubt(&mut self, about: Doubtful, path: &Path, note: &str) {
        self.note(path, note);
        let doubt = Doubt { about, note: format!("{}: {note}", path.display()) };
        if !self.doubts.contains(&doubt) {
            self.doubts.push(doubt);
        }
    }

    /// Adds what has to be said of a file.
    pub(crate) fn note(&mut self, path: &Path, note: &str) {
        let note = format!("{}: {note}", path.display());
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// The body in the shape and with the expression of a track, which `source` holds; `name` is the file that it names. What
    /// the body makes of the track is noted.
    pub(crate) fn of_track(
        &mut self,
        source: &Path,
        name: Option<&str>,
        track: &PoseTrack,
    ) -> Result<Arc<RestBody>, Error> {
        let path = self.find(source, name)?;
        self.posed(source, &path, track)
    }

    /// As [`Models::of_track`], of the model that is told by family and gender; [`Options::gender`] goes before the subject's.
    pub(crate) fn of_person(
        &mut self,
        source: &Path,
        family: Family,
        gender: Gender,
        track: &PoseTrack,
    ) -> Result<Arc<RestBody>, Error> {
        let asked = self.options.gender.unwrap_or(gender);
        let path = self.path_of(source, family, asked)?;
        let body = self.posed(source, &path, track)?;
        if let Some(note) = self.other_gender(&path, gender) {
            self.doubt(Doubtful::Gender, &path, &note);
        }
        Ok(body)
    }

    /// What has to be said of a body of another gender than the subject's, or than was asked for: a model that was given may
    /// be another's.
    fn other_gender(&self, path: &Path, subject: Gender) -> Option<String> {
        let asked = self.options.gender;
        let given = self.options.model.as_deref().is_some_and(|model| model == path);
        let own = Gender::in_name(&listing::stem(path)).or(asked.filter(|_| !given))?;
        let word = own.name();
        match asked {
            Some(asked) if asked != own => Some(format!(
                "a {word} body, which the registry gives; the table asks for the {} one",
                asked.name()
            )),
            Some(_) if own != subject => {
                Some(format!("the {word} body, as the table asks; the subject is {}", subject.name()))
            }
            None if own != subject => Some(format!("a {word} body; the subject is {}", subject.name())),
            _ => None,
        }
    }

    fn posed(&mut self, source: &Path, path: &Path, track: &PoseTrack) -> Result<Arc<RestBody>, Error> {
        let body = self.shaped(source, path, &track.betas, &track.expression)?;
        track.notes_for(&body.skeleton).iter().for_each(|note| self.note(source, note));
        Ok(body)
    }

    /// The file of the model that is told by family and gender: the given file; else in the given folder, or in `models` of
    /// the subject's folder or of one of the two above it, one of the names under which the models are distributed.
    pub(crate) fn path_of(&self, source: &Path, family: Family, gender: Gender) -> Result<PathBuf, Error> {
        let stems = family.file_stems(gender);
        let folders = match &self.options.model {
            // A folder, or what would be one if it were there.
            Some(model) if model.is_dir() || (model.extension().is_none() && !model.is_file()) => {
                vec![model.clone()]
            }
            Some(model) => return Ok(model.clone()),
            None => self.places(),
        };
        let below = |folder: &PathBuf| ["", "smpl", "smplx"].map(|name| folder.join(name));
        let files = folders.iter().flat_map(below).flat_map(|folder| {
            stems
                .iter()
                .flat_map(move |stem| ["npz", "pkl"].map(|end| folder.join(format!("{stem}.{end}"))))
                .collect::<Vec<_>>()
        });
        files.into_iter().find(|path| path.is_file()).ok_or_else(|| {
            let place = match &self.options.model {
                Some(model) => model.display().to_string(),
                None => "models/ of the subject's folder or of one of the two above it".to_owned(),
            };
            let problem = format!("no {} body", gender.name());
            Error::invalid(source, "body model", problem, format!("{}.npz or .pkl in {place}", stems[0]))
        })
    }

    fn shaped(
        &mut self,
        source: &Path,
        path: &Path,
        betas: &[f64],
        expression: &[f64],
    ) -> Result<Arc<RestBody>, Error> {
        if !self.loaded.contains_key(path) {
            let body::Loaded { body, notes } = body::read(path).map_err(|e| e.about("body model"))?;
            notes.iter().for_each(|note| self.note(path, note));
            self.loaded.insert(path.to_owned(), Model { body, shapes: Vec::new() });
        }
        let coefficients = [betas, expression].map(<[f64]>::to_vec);
        let Model { body, shapes } = self.loaded.get_mut(path).expect("inserted above");
        if let Some((_, rest)) = shapes.iter().find(|(known, _)| *known == coefficients) {
            return Ok(rest.clone());
        }
        let directions = body.shape.as_ref().map_or(0, |own| own.directions.len());
        let fit = ShapeFit {
            file: source.to_owned(),
            betas: betas.iter().rposition(|&beta| beta != 0.0).map_or(0, |last| last + 1),
            directions,
        };
        let (mut rest, notes) = body::shape(body, betas, expression).map_err(|e| Error::scene(source, e))?;
        let offsets = self.subject.join("gt_normal_offset.npy");
        if self.options.clothing && offsets.is_file() {
            let of_body = |e: Error| e.about("body model");
            let array = npy::read(&offsets).map_err(of_body)?;
            if let Some(i) = array.values.iter().position(|v| v.is_nan() || v.abs() > THICKEST) {
                let problem = format!("{:e}", array.values[i]);
                let expected = format!("metres of clothing, at most {THICKEST}");
                return Err(Error::invalid(&offsets, format!("body model offsets[{i}]"), problem, expected));
            }
            let values: Vec<f32> = array.values.iter().map(|&v| v as f32).collect();
            rest = rest.with_normal_offset(&values).map_err(|e| of_body(Error::scene(&offsets, e)))?;
        }
        let rest = Arc::new(rest);
        shapes.push((coefficients, rest.clone()));
        if !self.shapes.contains(&fit) {
            self.shapes.push(fit);
        }
        let few = betas.len() < directions.min(FEWEST_BETAS);
        for note in &notes {
            match few && note.starts_with("betas") {
                true => self.doubt(Doubtful::Betas, source, note),
                false => self.note(source, note),
            }
        }
        if betas.is_empty() && directions > 0 {
            let note = format!("no betas, for a model of {directions} directions: the mean shape");
            self.doubt(Doubtful::Betas, source, &note);
        }
        Ok(rest)
    }

    /// A given model, or the named one in one of [`Models::places`].
    fn find(&self, source: &Path, name: Option<&str>) -> Result<PathBuf, Error> {
        match (&self.options.model, name) {
            (Some(model), Some(name)) if model.is_dir() => return Ok(model.join(name)),
            (Some(model), _) => return Ok(model.clone()),
            (None, _) => {}
        }
        let Some(name) = name else {
            return Err(Error::invalid(source, "body model", "missing", "a body model, named here or given"));
        };
        let found = || self.places().iter().map(|place| place.join(name)).find(|path| path.is_file());
        let inside = super::listing::stays_inside(name, 0);
        inside.then(found).flatten().ok_or_else(|| {
            let expected = "a file in models/ of the subject's folder or of one of the two above it";
            Error::invalid(source, "body model", format!("{name} not found"), expected)
        })
    }

    /// `models` of the subject's folder and of the two above it; of a folder that is a link, above either of its ends.
    fn places(&self) -> Vec<PathBuf> {
        let beside_link = std::path::absolute(self.subject).unwrap_or_else(|_| self.subject.to_owned());
        let above_link = beside_link.ancestors().skip(1).take(2).map(Path::to_owned);
        let above_target = ["..", "../.."].map(|up| self.subject.join(up));
        let folders = std::iter::once(self.subject.to_owned()).chain(above_link).chain(above_target);
        folders.map(|folder| folder.join("models")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn male_is_part_of_female() {
        for (name, gender) in [
            ("female-3-casual", Some(Gender::Female)),
            ("male-4-casual", Some(Gender::Male)),
            ("SMPL_NEUTRAL.pkl", Some(Gender::Neutral)),
            ("FEMALE_1", Some(Gender::Female)),
            ("basicModel_f_lbs", None),
            ("someone", None),
        ] {
            assert_eq!(Gender::in_name(name), gender, "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_linked_subject_finds_models_above_either_end() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["store/far/subject", "project/data", "project/models", "store/models"] {
            std::fs::create_dir_all(at(name)).unwrap();
        }
        std::os::unix::fs::symlink(at("store/far/subject"), at("project/data/subject")).unwrap();
        std::fs::write(at("project/models/body.npz"), b"x").unwrap();
        std::fs::write(at("store/models/SMPL_MALE.npz"), b"x").unwrap();
        let subject = at("project/data/subject");
        let options = Options::default();
        let models = Models::new(&subject, &options);
        let found = models.find(&subject, Some("body.npz")).unwrap();
        assert!(found.ends_with("project/models/body.npz"), "{}", found.display());
        let found = models.path_of(&subject, Family::Smpl, Gender::Male).unwrap();
        assert!(found.ends_with("SMPL_MALE.npz"), "{}", found.display());
        let error = models.path_of(&subject, Family::Smpl, Gender::Female).unwrap_err().to_string();
        assert!(
            error.contains("body model: no female body; expected SMPL_FEMALE.npz or .pkl in models/"),
            "{error}"
        );
    }
}
