//! PeopleSnapshot as its authors distribute it (Video Based Reconstruction of 3D People Models).
//!
//! ```text
//! <subject>/camera.pkl                  of Python 2: camera_f, camera_c, camera_k, camera_rt, camera_t, width, height
//!           <subject>.mp4               the video; its frames in frames/ or images/, extracted with
//!                                       ffmpeg -i <subject>.mp4 -start_number 0 frames/%06d.png
//!           masks.hdf5                  masks (N, H, W), 0 and 1
//!           reconstructed_poses.hdf5    pose (N, 72), trans (N, 3), betas (10)
//!           consensus.pkl               v_personal (V, 3), betas: the clothed shape (used if there)
//! ```
//! Frames and masks are undistorted when they are asked for, as every preparation script does it ([`distortion`](super::distortion)). The body is the
//! shape of `betas` with `v_personal` added to its vertices; joints are those of the shape without it. `camera_rt` and `camera_t`
//! lead from the world into the camera.
//!
//! Layout: `prepare_data/create_camera.py`, `prepare_data/masks2hdf5.py`, `step1_pose.py`, `step2_consensus.py`, `models/smpl.py`
//! of videoavatars febcbb8.

use super::distortion::Distortion;
use super::peoplesnapshot::gender;
use super::split::{self, Splits};
use super::video::Numbered;
use super::{Layout, Part as Place, Request, Shared, triples};
use crate::digest::Fingerprint;
use crate::folder::Subject;
use crate::hdf5::{Hdf5, Rows};
use crate::models::{Doubt, Doubtful, Family, Gender, Models};
use crate::pickle::Pickle;
use crate::poses::{Part, PoseTrack};
use crate::{
    Capture, Error, FrameGenerator, FrameRef, FrameSource, Sequence, Sourced, Truth, error, frames, listing,
};
use glam::{DMat3, DMat4, DVec3};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Camera, Mask, Pose, RestBody};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(super) const LAYOUT: Layout = Layout {
    id: "peoplesnapshot-raw",
    summary: "PeopleSnapshot as distributed: camera.pkl, masks.hdf5, reconstructed_poses.hdf5, consensus.pkl, extracted frames",
    parts: &[
        Place::needed("frames", "frames/*.{png,jpg,jpeg}"),
        Place::needed("frames", "images/*.{png,jpg,jpeg}"),
        Place::optional("video", "*.{mp4,avi,mov}"),
        Place::needed("masks", "masks.hdf5").of_arrays(&["masks"]).telling(),
        Place::needed("camera", "camera.pkl")
            .of_arrays(&["camera_f", "camera_c", "camera_k", "camera_rt", "camera_t", "width", "height"])
            .telling(),
        Place::needed("poses", "reconstructed_poses.hdf5").of_arrays(&["pose", "trans", "betas"]).telling(),
        Place::optional("clothed shape", "consensus.pkl").of_arrays(&["v_personal", "betas"]).telling(),
    ],
    load,
};

/// Loads the two sequences, `train` and `test`, of a subject.
///
/// # Errors
/// Missing or malformed files, counts that do not match, a split that leaves the video.
fn load(request: &Request<'_>) -> Result<Subject, Error> {
    let folder = request.folder;
    let splits = Splits::of(request, None)?;
    let (gender, mut notes) = gender(folder, None)?;
    let (camera, distortion) = camera(&folder.join("camera.pkl")).map_err(|e| e.about("camera"))?;
    let masks = masks(&folder.join("masks.hdf5"), &camera).map_err(|e| e.about("masks"))?;
    let count = masks.shape()[0];
    let mut images = extracted(folder)?;
    images.fit_within(count, masks.path(), "masks")?;
    let mut models = Models::new(folder, request.options);
    let (body, poses) = person(folder, count, gender, &mut models, &mut notes)?;
    let undone =
        Doubt { about: Doubtful::Camera, note: "frames and masks are undistorted with camera_k".to_owned() };
    let doubts: Vec<Doubt> = (!distortion.is_none()).then_some(undone).into_iter().collect();
    notes.extend(doubts.iter().map(|doubt| doubt.note.clone()));
    notes.extend_from_slice(models.notes());
    let shared = Shared { body, poses, cameras: vec![camera.clone()].into() };
    let video = Video { folder, images, masks: Arc::new(masks), camera, distortion, shared };
    let sequence = |part: &str| Ok::<_, Error>(vec![video.sequence(part, splits.ranges(part)[0])?]);
    let (train, test) = (sequence("train")?, sequence("test")?);
    let subject = request.subject(Capture::Monocular, train, test, notes);
    Ok(models.told(Subject { doubts, ..subject }))
}

/// What both sequences are cut from.
struct Video<'a> {
    folder: &'a Path,
    images: Numbered,
    masks: Arc<Rows>,
    camera: Camera,
    distortion: Distortion,
    shared: Shared,
}

impl Video<'_> {
    fn sequence(&self, id: &str, range: split::Range) -> Result<Sequence, Error> {
        let frame = |time: usize| {
            let image = self.images.frame(time)?.clone();
            let name = listing::stem(&image);
            let size = [self.camera.width, self.camera.height];
            let made =
                RawFrame { image, masks: self.masks.clone(), row: time, size, distortion: self.distortion };
            let source = FrameSource::Generated { generator: Arc::new(made), frame: 0 };
            Ok(FrameRef { name, time, pose: time, camera: 0, source })
        };
        let chosen = split::chosen(self.folder, id, range, self.masks.shape()[0])?;
        Ok(self.shared.sequence(id, chosen.into_iter().map(frame).collect::<Result<_, Error>>()?))
    }
}

/// One frame of a video and its row of masks.
#[derive(Debug)]
struct RawFrame {
    image: PathBuf,
    masks: Arc<Rows>,
    row: usize,
    size: [u32; 2],
    distortion: Distortion,
}

impl FrameGenerator for RawFrame {
    fn truth(&self, _: usize) -> Result<Truth, Error> {
        let [width, height] = self.size.map(|side| side as usize);
        let (image, _) = frames::load_image(&self.image)?;
        if (image.width(), image.height()) != (width, height) {
            let problem = format!("{}x{}", image.width(), image.height());
            return Err(Error::invalid(
                &self.image,
                "image size",
                problem,
                format!("camera.pkl's {width}x{height}"),
            ));
        }
        let scene = |e| Error::scene(self.masks.path(), e).about("masks");
        let stored = self.masks.row(self.row)?;
        let highest = stored.iter().fold(0.0f64, |highest, &v| highest.max(v.abs()));
        // Bytes of 255 may be stored as -1.
        let covered = |&v: &f64| if highest > 1.0 { (v / 255.0) as f32 } else { v.abs() as f32 };
        let mask = Mask::new(width, height, stored.iter().map(covered).collect()).map_err(scene)?;
        if self.distortion.is_none() {
            return Ok(Truth::new(image, mask));
        }
        let rgb = self.distortion.undone(&image).map_err(|e| Error::scene(&self.image, e).about("image"))?;
        Ok(Truth::new(rgb, self.distortion.undone_mask(&mask).map_err(scene)?))
    }

    fn key(&self) -> Result<String, Error> {
        let mut hash = Fingerprint::new();
        hash.bytes(&error::read_bytes(&self.image, "image", "a frame of the video")?);
        hash.numbers(self.masks.row(self.row)?);
        hash.numbers(self.distortion.numbers());
        Ok(format!("video frame {}", hash.finish()))
    }
}

/// The camera and its distortion.
fn camera(path: &Path) -> Result<(Camera, Distortion), Error> {
    let pickle = Pickle::read(path, "camera")?;
    let numbers = |name: &str, shape: &str| Ok::<_, Error>(pickle.get(name)?.numbers(shape)?.values);
    let pair = |values: Vec<f64>| [values[0], values[1]];
    let (focal, centre) = (pair(numbers("camera_f", "2")?), pair(numbers("camera_c", "2")?));
    let coefficients = numbers("camera_k", "*")?;
    if ![4, 5].contains(&coefficients.len()) {
        let problem = format!("{} coefficients", coefficients.len());
        return Err(Error::invalid(path, "camera_k", problem, "5: k1 k2 p1 p2 k3"));
    }
    let coefficients = std::array::from_fn(|i| coefficients.get(i).copied().unwrap_or_default());
    let (turn, shift) = (numbers("camera_rt", "3")?, numbers("camera_t", "3")?);
    let rotation = DMat3::from_quat(portable::from_scaled_axis(DVec3::from_slice(&turn)));
    let side = |name: &str| {
        let count = pickle.get(name)?.count()?;
        u32::try_from(count)
            .map_err(|cause| Error::invalid(path, name, cause.to_string(), "a number of pixels"))
    };
    let camera = Camera {
        width: side("width")?,
        height: side("height")?,
        fx: focal[0],
        fy: focal[1],
        cx: centre[0],
        cy: centre[1],
        camera_from_world: DMat4::from_translation(DVec3::from_slice(&shift)) * DMat4::from_mat3(rotation),
    };
    camera.validate().map_err(|e| Error::scene(path, e))?;
    Ok((camera, Distortion { focal, centre, coefficients }))
}

/// The masks, of the camera's size.
fn masks(path: &Path, camera: &Camera) -> Result<Rows, Error> {
    let rows = Hdf5::open(path, "masks")?.rows("masks")?;
    let size = [camera.height as usize, camera.width as usize];
    if rows.shape().len() != 3 || rows.shape()[1..] != size {
        let expected = format!("(N, {}, {}), the camera's size", size[0], size[1]);
        return Err(Error::invalid(path, "masks", format!("shape {:?}", rows.shape()), expected));
    }
    Ok(rows)
}

/// The frames that were extracted from the video.
fn extracted(folder: &Path) -> Result<Numbered, Error> {
    let place = ["frames", "images"].map(|name| folder.join(name)).into_iter().find(|place| place.is_dir());
    if let Some(place) = place {
        return Numbered::open(place, "frames", &["png", "jpg", "jpeg"]);
    }
    let videos = listing::files(folder, "frames", &["mp4", "avi", "mov"])?;
    let name = videos
        .first()
        .map_or_else(|| format!("{}.mp4", listing::file_name(folder)), |path| listing::file_name(path));
    let problem = if videos.is_empty() {
        "no folder frames, no video".to_owned()
    } else {
        format!("only {name} is here")
    };
    let expected = format!("its frames: mkdir frames && ffmpeg -i {name} -start_number 0 frames/%06d.png");
    Err(Error::invalid(folder, "frames", problem, expected))
}

/// The body, clothed where its clothes are known, and its poses.
fn person(
    folder: &Path,
    count: usize,
    gender: Gender,
    models: &mut Models,
    notes: &mut Vec<String>,
) -> Result<(Arc<RestBody>, Sourced<Vec<Pose>>), Error> {
    let path = folder.join("reconstructed_poses.hdf5");
    let mut track = track(&path, count).map_err(|e| e.about("poses"))?;
    let consensus = folder.join("consensus.pkl");
    let body = match consensus.is_file() {
        false => models.of_person(&path, Family::Smpl, gender, &track)?,
        true => clothed(&consensus, &mut track, gender, models, notes)?,
    };
    let poses = track.poses(&body.skeleton).map_err(|e| e.about("poses"))?;
    Ok((body, poses))
}

/// The poses of so many frames, and the shape beside them.
fn track(path: &Path, count: usize) -> Result<PoseTrack, Error> {
    let file = Hdf5::open(path, "poses")?;
    let (pose, trans) = (file.array("pose", &[0, 72])?, file.array("trans", &[0, 3])?);
    for (field, found) in [("pose", pose.shape[0]), ("trans", trans.shape[0])] {
        if found != count {
            let expected = format!("{count}, one per mask of masks.hdf5");
            return Err(Error::invalid(path, field, format!("{found} rows"), expected));
        }
    }
    let is_row = file.rows("betas")?.shape().len() == 2;
    let betas = file.array("betas", if is_row { &[1, 0] } else { &[0] })?.values;
    let parts = vec![(Part::Whole, pose.values)];
    PoseTrack::from_parts(path, betas, parts, triples(&trans.values))
}

/// The shape of `consensus.pkl`.
fn clothed(
    path: &Path,
    track: &mut PoseTrack,
    gender: Gender,
    models: &mut Models,
    notes: &mut Vec<String>,
) -> Result<Arc<RestBody>, Error> {
    let of_body = |e: Error| e.about("body model");
    let pickle = Pickle::read(path, "consensus").map_err(of_body)?;
    let own = pickle.get("betas")?;
    let own = own.numbers("1,*").or_else(|_| own.numbers("*"))?.values;
    let far = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-5;
    if own.len() != track.betas.len() || own.iter().zip(&track.betas).any(far) {
        notes.push(
            "betas of consensus.pkl, to which v_personal belongs; those of reconstructed_poses.hdf5 differ"
                .into(),
        );
        track.betas = own;
    }
    let offsets = pickle.get("v_personal").and_then(|own| own.numbers("V,3")).map_err(of_body)?;
    let mut body = (*models.of_person(path, Family::Smpl, gender, track)?).clone();
    if offsets.shape[0] != body.vertices.len() {
        let problem = format!("{} offsets", offsets.shape[0]);
        return Err(Error::invalid(
            path,
            "body model v_personal",
            problem,
            format!("{}, one per vertex", body.vertices.len()),
        ));
    }
    body.vertices.iter_mut().zip(triples(&offsets.values)).for_each(|(vertex, offset)| *vertex += offset);
    body.validate().map_err(|e| of_body(Error::scene(path, e)))?;
    notes.push("the body has the clothing of consensus.pkl (v_personal)".to_owned());
    Ok(Arc::new(body))
}
