#![doc = include_str!("../README.md")]

mod bodies;
mod edges;
mod findings;
mod genders;
mod lens;
mod masks;
mod overlays;
mod parts;
mod shadows;
mod timing;
mod zoom;

pub use genders::of_another_gender;
pub use overlays::write as write_overlays;

use rayon::prelude::*;
use serde::Serialize;
use shadows::Shadow;
use skinsplat_core::scene::{Camera, Mask, PosedBody};
use skinsplat_data::{Doubt, Doubtful, Error, Sequence, ShapeFit, Subject};
use skinsplat_render::mesh::{Mesh, SamplePattern, silhouette};

/// Longer side at which silhouettes are compared, pixels.
const SIDE: u32 = 256;

/// What is wrong with a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Masks that mark the background.
    InvertedMasks,
    /// Masks whose values are labels, or 0 and 1 of 255.
    MaskRange,
    /// Poses that belong to other frames.
    FrameOffset,
    /// Another number of poses than of frames.
    PoseCount,
    /// Shape coefficients of another number than the body model's.
    BetasSize,
    /// A body of another size than the person.
    WrongGenderOrModel,
    /// A focal length or principal point that is far off, or distortion.
    Camera,
    /// Images or masks that are not there or cannot be read.
    MissingFrames,
    /// A mask without a pixel.
    EmptyMask,
    /// A body that the camera does not see.
    BodyOutOfView,
}

impl std::fmt::Display for Kind {
    /// Its id.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.serialize(f)
    }
}

impl Kind {
    /// True if numbers made from such data mean nothing.
    pub fn spoils(self) -> bool {
        !matches!(self, Self::EmptyMask | Self::MaskRange | Self::BodyOutOfView | Self::BetasSize)
    }
}

/// Something that is wrong, or may be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What.
    pub kind: Kind,
    /// In which sequence.
    pub sequence: String,
    /// Which frames, by how much.
    pub detail: String,
    /// True if numbers made from this data mean nothing.
    pub spoils: bool,
}

impl Finding {
    fn new(kind: Kind, sequence: &str, detail: impl Into<String>) -> Self {
        Self { kind, sequence: sequence.to_owned(), detail: detail.into(), spoils: kind.spoils() }
    }

    /// The finding behind a subject that cannot be loaded: no number can be made from it. Told by the field that the error is about, else
    /// by the file; what is not there, or is about nothing in particular, is missing.
    pub fn of_error(error: &Error) -> Self {
        let named =
            |name: Option<&std::ffi::OsStr>| name.map_or(String::new(), |name| name.to_string_lossy().into());
        let places = [error.field().to_owned(), named(error.path().file_name())];
        let folder = named(error.path().parent().and_then(|folder| folder.file_name()));
        let kind = places.iter().chain([&folder]).find_map(|name| kind_of(&name.to_lowercase()));
        Self { spoils: true, ..Self::new(kind.unwrap_or(Kind::MissingFrames), "", error.to_string()) }
    }
}

/// What a field, a file or a folder of this name is about.
fn kind_of(name: &str) -> Option<Kind> {
    const WORDS: [(Kind, &[&str]); 5] = [
        (Kind::BetasSize, &["betas", "shapedirs", "mean_shape"]),
        (Kind::Camera, &["camera", "intrinsic", "extrinsic", "w2c", "focal"]),
        (
            Kind::PoseCount,
            &[
                "pose",
                "theta",
                "global_orient",
                "trans",
                "smpl_o",
                "alignments",
                "scale",
                "expression",
                "mesh-f",
            ],
        ),
        (Kind::MissingFrames, &["image", "mask", "frame", "depth", "background", "video"]),
        (
            Kind::WrongGenderOrModel,
            &[
                "gender",
                "model",
                "body",
                "weights",
                "v_template",
                "v_personal",
                "consensus",
                "regressor",
                "rig",
                "smpl_",
                "smplx_",
            ],
        ),
    ];
    // X-Humans has its poses in a folder of this name.
    let told = || {
        WORDS.iter().find(|(_, words)| words.iter().any(|word| name.contains(word))).map(|(kind, _)| *kind)
    };
    if name == "smplx" { Some(Kind::PoseCount) } else { told() }
}

/// How well one frame fits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameFit {
    /// Name of the frame.
    pub name: String,
    /// Intersection over union of the body's silhouette and the mask; none if the frame cannot be read.
    pub silhouette_iou: Option<f64>,
}

/// How well a sequence fits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SequenceFit {
    /// Id.
    pub id: String,
    /// The frames that were looked at.
    pub frames: Vec<FrameFit>,
    /// Mean over frames that have an overlap.
    pub mean_iou: Option<f64>,
}

/// One frame, at the resolution of the comparison.
struct Seen {
    /// Index in its sequence.
    index: usize,
    camera: Camera,
    /// The mask and the body's silhouette, or why there are none.
    shadows: Result<Shadows, Problem>,
}

/// Where a body of another size would stay, pixels: its middle, and the origin of its model; none behind the camera.
type Centres = [Option<[f64; 2]>; 2];

struct Shadows {
    mask: Shadow,
    body: Shadow,
    centres: Centres,
}

struct Problem {
    kind: Kind,
    text: String,
}

/// What a subject's own files say, before any frame is looked at: shapes that are larger or smaller than its body model's, cameras that
/// were simplified, a body of another gender. `sequence` of the findings is empty.
pub fn subject(subject: &Subject) -> Vec<Finding> {
    let of_doubt = |Doubt { about, note }: &Doubt| {
        let kind = match about {
            Doubtful::Camera => Kind::Camera,
            Doubtful::Gender => Kind::WrongGenderOrModel,
            Doubtful::Betas => Kind::BetasSize,
        };
        Finding { spoils: false, ..Finding::new(kind, "", note.clone()) }
    };
    let cut = subject.shapes.iter().filter(|shape| shape.betas > shape.directions);
    let finding = |shape: &ShapeFit| {
        let ShapeFit { file, betas, directions } = shape;
        let detail = format!(
            "{}: {betas} shape coefficients for a model of {directions} directions: another model, or a shape that is not whole",
            file.display()
        );
        Finding::new(Kind::BetasSize, "", detail)
    };
    cut.map(finding).chain(subject.doubts.iter().map(of_doubt)).collect()
}

/// Compares silhouettes and masks of some frames of a sequence, in their order, and names what is wrong.
pub fn sequence(sequence: &Sequence, frames: &[usize]) -> (SequenceFit, Vec<Finding>) {
    let small = sequence.reduced(SIDE);
    let seen: Vec<Seen> = frames.par_iter().map(|&index| look(&small, index)).collect();
    let overlap = |seen: &Seen| seen.shadows.as_ref().ok().and_then(|s| s.body.overlap(&s.mask));
    let frame = |seen: &Seen| FrameFit {
        name: sequence.frames[seen.index].name.clone(),
        silhouette_iou: overlap(seen),
    };
    let overlaps: Vec<f64> = seen.iter().filter_map(overlap).collect();
    let mean_iou = (!overlaps.is_empty()).then(|| overlaps.iter().sum::<f64>() / overlaps.len() as f64);
    let fit = SequenceFit { id: sequence.id.clone(), frames: seen.iter().map(frame).collect(), mean_iou };
    (fit, findings::of(sequence, &small, &seen))
}

fn look(small: &Sequence, index: usize) -> Seen {
    let camera = small.cameras[small.frames[index].camera].clone();
    let shadows = shadows_of(small, index, &camera);
    Seen { index, camera, shadows }
}

fn shadows_of(small: &Sequence, index: usize, camera: &Camera) -> Result<Shadows, Problem> {
    let truth = small.truth(index).map_err(|error| {
        let text = error.to_string();
        let kind = match error.field() {
            // Another size than the camera's.
            "image size" => Kind::Camera,
            _ if text.contains("a map of labels") => Kind::MaskRange,
            _ => Kind::MissingFrames,
        };
        Problem { kind, text }
    })?;
    let (body, centres) = project(small, index, camera)
        .map_err(|error| Problem { kind: Kind::PoseCount, text: error.to_string() })?;
    Ok(Shadows { mask: Shadow::of(&truth.alpha), body: Shadow::of(&body), centres })
}

/// The silhouette of the posed body, and where its middle and its model's origin are seen.
fn project(
    sequence: &Sequence,
    index: usize,
    camera: &Camera,
) -> Result<(Mask, Centres), skinsplat_core::scene::SceneError> {
    let pose = &sequence.poses[sequence.frames[index].pose];
    let body = PosedBody::new(&sequence.body, pose)?;
    let mesh = body.mesh();
    let shadow =
        silhouette(&Mesh::new(&mesh.vertices, &sequence.body.faces)?, camera, SamplePattern::new(2))?;
    let count = mesh.vertices.len().max(1) as f64;
    let middle = mesh.vertices.iter().map(|v| v.as_dvec3()).sum::<glam::DVec3>() / count;
    Ok((shadow, [middle, pose.translation].map(|centre| Some(camera.project(centre)?.0.to_array()))))
}
