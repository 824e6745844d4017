//! X-Humans, the data set of X-Avatar.
//!
//! ```text
//! <subject>/gender.txt                                   female, male or neutral
//!           mean_shape_smplx.npy                         betas (10): these, not those of the pickles
//!           train/Take4/render/image/color_000001.png    rendered scans, black background
//!                       render/depth/depth_000001.tiff   metres; the background is at the far plane, 1000
//!                       render/cameras.npz               intrinsic (3, 3), extrinsic (N, 4, 4), world to camera
//!                       SMPLX/mesh-f00001_smplx.pkl      global_orient, body_pose (63), hands (45 each), jaw, eyes, transl
//!           test/Take9/...
//! ```
//! Takes are sequences called `train/Take4`. A take may start anywhere and have gaps: its frames are those of its images, by
//! number; row i of the extrinsics belongs to the i-th of them. Hands are full axis-angle vectors to which the model's
//! `hands_mean` is added (`use_pca` and `flat_hand_mean` are False).
//!
//! The mask is where the largest depth less the depth is above 700, as HAHA takes it. HAHA cuts the middle W rows out of a
//! picture of W columns and H rows and gives its camera the field of view FoVy / (H / W), which squeezes the body by 1.3 %; here
//! the same rows are cut out and the camera is the same camera of those rows: focal lengths stay, `cy` is shifted.
//! Expressions move vertices frame by frame, which a body of one shape cannot follow: they are left out.
//!
//! Layout: `data_process/README.md` of X-Avatar 7a071b6, `dataloaders/xhuman_loader.py` and `runners/train_gaussians.py` of HAHA
//! 2ffefe2.

use super::{Layout, Part as Place, Request};
use crate::camera::rigid;
use crate::digest::Fingerprint;
use crate::folder::Subject;
use crate::models::{Family, Gender, Models};
use crate::npz::Archive;
use crate::pickle::Pickle;
use crate::poses::{Hands, Part, PoseTrack};
use crate::{
    Capture, Error, FrameGenerator, FrameRef, FrameSource, Sequence, Truth, depth, error, frames, image_size,
    listing, npy,
};
use glam::{DMat3, DMat4, DVec3};
use skinsplat_core::scene::{Camera, Image, Mask};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(super) const LAYOUT: Layout = Layout {
    id: "xhumans",
    summary: "X-Humans: gender.txt, mean_shape_smplx.npy, takes in train and test with render/ and SMPLX/",
    parts: &[
        Place::needed("gender", "gender.txt").telling(),
        Place::needed("shape", "mean_shape_smplx.npy").telling(),
        Place::needed("training images", "train/*/render/image/*.{png,jpg,jpeg}").telling(),
        Place::needed("training depth", "train/*/render/depth/depth_*.tiff").telling(),
        Place::needed("training cameras", "train/*/render/cameras.npz").of_arrays(&CAMERA_ARRAYS).telling(),
        Place::needed("training poses", "train/*/SMPLX/mesh-f*_smplx.pkl").of_arrays(&POSE_ARRAYS).telling(),
        Place::optional("test images", "test/*/render/image/*.{png,jpg,jpeg}").telling(),
        Place::optional("test depth", "test/*/render/depth/depth_*.tiff").telling(),
        Place::optional("test cameras", "test/*/render/cameras.npz").of_arrays(&CAMERA_ARRAYS).telling(),
        Place::optional("test poses", "test/*/SMPLX/mesh-f*_smplx.pkl").of_arrays(&POSE_ARRAYS).telling(),
    ],
    load,
};

/// How much nearer than the background the person is, metres.
const NEARER: f32 = 700.0;

/// The parts of an SMPL-X pose, as the pickles name them, and how many numbers each has.
const PARTS: [(&str, Part, usize); 7] = [
    ("global_orient", Part::GlobalOrient, 3),
    ("body_pose", Part::BodyPose, 63),
    ("jaw_pose", Part::Jaw, 3),
    ("leye_pose", Part::LeftEye, 3),
    ("reye_pose", Part::RightEye, 3),
    ("left_hand_pose", Part::LeftHand, 45),
    ("right_hand_pose", Part::RightHand, 45),
];

/// What is read of a take's cameras.
const CAMERA_ARRAYS: [&str; 2] = ["intrinsic", "extrinsic"];

/// What is read of a frame's pose: [`PARTS`] and where the body stands. Betas are the subject's.
const POSE_ARRAYS: [&str; 9] =
    [PARTS[0].0, PARTS[1].0, PARTS[2].0, PARTS[3].0, PARTS[4].0, PARTS[5].0, PARTS[6].0, "transl", "trans"];

/// Loads every take of a subject.
///
/// # Errors
/// Missing or malformed files, takes whose images, depths, cameras and poses do not match.
fn load(request: &Request<'_>) -> Result<Subject, Error> {
    let folder = request.folder;
    let gender_path = folder.join("gender.txt");
    let name = error::read_text(&gender_path, "gender", "female, male or neutral")?;
    let gender = Gender::named(&name).ok_or_else(|| {
        let problem = name.trim().escape_debug().to_string();
        Error::invalid(&gender_path, "gender", format!("\"{problem}\""), "female, male or neutral")
    })?;
    let betas = betas(&folder.join("mean_shape_smplx.npy")).map_err(|e| e.about("betas"))?;
    let mut person = Person {
        gender,
        betas,
        models: Models::new(folder, request.options),
        expressive: 0,
        absent: BTreeSet::new(),
    };
    let mut part = |part: &str| -> Result<Vec<Sequence>, Error> {
        let place = folder.join(part);
        let takes = if place.is_dir() { listing::folders(&place, "takes")? } else { Vec::new() };
        let mut take = |take: &PathBuf| person.take(take, format!("{part}/{}", listing::file_name(take)));
        takes.iter().map(&mut take).collect()
    };
    let (train, test) = (part("train")?, part("test")?);
    if train.is_empty() && test.is_empty() {
        return Err(Error::invalid(folder, "takes", "none", "folders in train/ and test/"));
    }
    let mut notes = person.models.notes().to_vec();
    notes.extend(person.absent.iter().map(|part| format!("{part}: not there, at rest")));
    if person.expressive > 0 {
        notes.push(format!("expressions are left out ({} frames have one)", person.expressive));
    }
    Ok(person.models.told(request.subject(Capture::Hands, train, test, notes)))
}

fn betas(path: &Path) -> Result<Vec<f64>, Error> {
    let array = npy::read(path)?;
    let flat = array.shape.iter().filter(|n| **n != 1).count() <= 1;
    if !flat || array.values.iter().any(|v| !v.is_finite()) {
        return Err(Error::invalid(path, "array", format!("shape {:?}", array.shape), "finite betas (10)"));
    }
    Ok(array.values)
}

/// Whose takes they are.
struct Person<'a> {
    gender: Gender,
    betas: Vec<f64>,
    models: Models<'a>,
    /// Frames whose expression is not zero.
    expressive: usize,
    /// Parts of the pose that files lack.
    absent: BTreeSet<&'static str>,
}

impl Person<'_> {
    fn take(&mut self, folder: &Path, id: String) -> Result<Sequence, Error> {
        let images = listing::numbered(&folder.join("render/image"), "images", &["png", "jpg", "jpeg"])?;
        let depths = Numbers::open(folder.join("render/depth"), "depth", &["tiff", "tif"])?;
        let smplx = Numbers::open(folder.join("SMPLX"), "poses", &["pkl"])?;
        let first = images.values().next().cloned().unwrap_or_default();
        let [width, height] = image_size::of(&first).map_err(|e| e.about("image"))?;
        let rows = Rows::middle(width, height);
        let cameras = cameras(&folder.join("render/cameras.npz"), images.len(), width, rows);
        // An image that is not there leaves one camera too many.
        let cameras = cameras.map_err(|error| {
            depths.without_image(folder, &images).unwrap_or_else(|| error.about("camera"))
        })?;
        let (mut tracks, mut frames) = (Vec::new(), Vec::new());
        for (i, (&number, image)) in images.iter().enumerate() {
            let depth = depths.of(number, format!("depth_{number:06}.tiff"))?;
            let smplx = smplx.of(number, format!("mesh-f{number:05}_smplx.pkl"))?;
            tracks.push(self.track(&smplx).map_err(|e| e.about("poses"))?);
            let made = RenderedFrame { image: image.clone(), depth, size: [width, height], rows };
            let source = FrameSource::Generated { generator: Arc::new(made), frame: 0 };
            frames.push(FrameRef { name: listing::stem(image), time: number, pose: i, camera: i, source });
        }
        let of_poses = |e: Error| e.about("poses");
        let track = PoseTrack::joined(&smplx.folder, tracks).map_err(of_poses)?.with_hands(Hands::Mean);
        let body = self.models.of_person(&smplx.folder, Family::Smplx, self.gender, &track)?;
        let poses = track.poses(&body.skeleton).map_err(of_poses)?;
        Ok(Sequence { id, body, poses, cameras: cameras.into(), frames, stored_sizes: None })
    }

    /// The pose of a frame.
    fn track(&mut self, path: &Path) -> Result<PoseTrack, Error> {
        let pickle = Pickle::read(path, "pose")?;
        let root = pickle.root();
        let values = |name: &str, count: usize| {
            let Some(found) = root.optional(name)? else { return Ok(None) };
            let values = found.array()?.values;
            if values.len() != count || values.iter().any(|v| !v.is_finite()) {
                let problem = format!("{} values", values.len());
                return Err(Error::invalid(path, name, problem, format!("{count} finite numbers")));
            }
            Ok(Some(values))
        };
        let mut parts = Vec::new();
        for (name, part, count) in PARTS {
            match values(name, count)? {
                Some(values) => parts.push((part, values)),
                // A part of the pose that is not there is at rest; a pose without a body is none.
                None if matches!(part, Part::GlobalOrient | Part::BodyPose) => {
                    pickle.get(name)?;
                }
                None => {
                    self.absent.insert(name);
                }
            }
        }
        let translation = match values("transl", 3)? {
            Some(values) => values,
            None => values("trans", 3)?.map_or_else(|| pickle.get("transl").map(|_| Vec::new()), Ok)?,
        };
        let translation = DVec3::from_slice(&translation);
        if let Some(expression) = pickle.root().optional("expression")? {
            self.expressive += usize::from(expression.array()?.values.iter().any(|&v| v != 0.0));
        }
        PoseTrack::from_parts(path, self.betas.clone(), parts, vec![translation])
    }
}

/// Files of a take that belong to images by their numbers.
struct Numbers {
    folder: PathBuf,
    field: &'static str,
    files: BTreeMap<usize, PathBuf>,
}

impl Numbers {
    fn open(folder: PathBuf, field: &'static str, extensions: &[&str]) -> Result<Self, Error> {
        let files = listing::numbered(&folder, field, extensions)?;
        Ok(Self { folder, field, files })
    }

    fn of(&self, number: usize, name: String) -> Result<PathBuf, Error> {
        let missing = || Error::invalid(&self.folder, self.field, format!("frame {number} is missing"), name);
        self.files.get(&number).cloned().ok_or_else(missing)
    }

    /// The first number that the images of a take lack.
    fn without_image(&self, take: &Path, images: &BTreeMap<usize, PathBuf>) -> Option<Error> {
        let number = self.files.keys().find(|number| !images.contains_key(number))?;
        let expected = format!("color_{number:06}.png: {} has it", self.field);
        let problem = format!("frame {number} is missing");
        Some(Error::invalid(take.join("render/image"), "images", problem, expected))
    }
}

/// Which rows of a picture are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Rows {
    first: u32,
    count: u32,
}

impl Rows {
    /// The middle ones of a picture that is higher than wide: as many as it has columns.
    fn middle(width: u32, height: u32) -> Self {
        match height > width {
            true => Self { first: (height - width) / 2, count: width },
            false => Self { first: 0, count: height },
        }
    }
}

/// A camera per frame, of the kept rows.
fn cameras(path: &Path, frames: usize, width: u32, rows: Rows) -> Result<Vec<Camera>, Error> {
    let mut archive = Archive::open(path, "cameras")?;
    let k = archive.require("intrinsic", "3,3")?.values;
    let extrinsics = archive.require("extrinsic", "N,4,4")?;
    if extrinsics.shape[0] != frames {
        let problem = format!("{} matrices", extrinsics.shape[0]);
        return Err(archive.invalid("extrinsic", problem, format!("{frames}, one per image")));
    }
    if [k[1], k[3], k[6], k[7], k[8]] != [0.0, 0.0, 0.0, 0.0, 1.0] {
        let problem = format!("skewed or not normalised: {k:?}");
        return Err(archive.invalid("intrinsic", problem, "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"));
    }
    let camera = |(i, matrix): (usize, &[f64])| {
        let entries: [f64; 16] = std::array::from_fn(|k| matrix[k]);
        let camera = Camera {
            width,
            height: rows.count,
            fx: k[0],
            fy: k[4],
            cx: k[2],
            cy: k[5] - f64::from(rows.first),
            camera_from_world: DMat4::from_cols_array(&entries).transpose(),
        };
        if let Some(fault) = rigid::fault(DMat3::from_mat4(camera.camera_from_world)) {
            return Err(archive.invalid(format!("extrinsic[{i}]"), fault, rigid::RIGID));
        }
        camera.validate().map_err(|mut e| {
            e.field = format!("extrinsic[{i}].{}", e.field);
            Error::scene(path, e)
        })?;
        Ok(camera)
    };
    extrinsics.values.chunks_exact(16).enumerate().map(camera).collect()
}

/// One frame of a take: the kept rows of its picture, and its mask from depth.
#[derive(Debug)]
struct RenderedFrame {
    image: PathBuf,
    depth: PathBuf,
    /// Of the whole picture.
    size: [u32; 2],
    rows: Rows,
}

impl RenderedFrame {
    fn check(&self, path: &Path, field: &str, found: [usize; 2]) -> Result<(), Error> {
        let [width, height] = self.size.map(|side| side as usize);
        if found == [width, height] {
            return Ok(());
        }
        let expected = format!("{width}x{height}, as the first image of the take");
        Err(Error::invalid(path, field, format!("{}x{}", found[0], found[1]), expected))
    }
}

impl FrameGenerator for RenderedFrame {
    fn truth(&self, _: usize) -> Result<Truth, Error> {
        let (image, _) = frames::load_image(&self.image)?;
        self.check(&self.image, "image size", [image.width(), image.height()])?;
        let depth = depth::load(&self.depth)?;
        self.check(&self.depth, "depth size", [depth.width, depth.height])?;
        let (width, count) = (depth.width, self.rows.count as usize);
        let kept = width * self.rows.first as usize..width * (self.rows.first as usize + count);
        let depths = &depth.values[kept.clone()];
        let farthest = depths.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let person = depths.iter().map(|&d| f32::from(farthest - d > NEARER)).collect();
        let rgb = Image::new(width, count, image.pixels()[kept].to_vec());
        let rgb = rgb.map_err(|e| Error::scene(&self.image, e))?;
        let alpha = Mask::new(width, count, person).map_err(|e| Error::scene(&self.depth, e))?;
        Ok(Truth::new(rgb, alpha))
    }

    fn key(&self) -> Result<String, Error> {
        let mut hash = Fingerprint::new();
        hash.bytes(&error::read_bytes(&self.image, "image", "a frame of the take")?);
        hash.bytes(&error::read_bytes(&self.depth, "depth", "a depth map of the take")?);
        hash.count(self.rows.first as usize).count(self.rows.count as usize);
        Ok(format!("rendered scan {}", hash.finish()))
    }
}
