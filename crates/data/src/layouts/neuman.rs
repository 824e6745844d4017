//! NeuMan, as its authors distribute it and as HUGS adds to it.
//!
//! ```text
//! <scene>/images/00000.png                                  one per frame
//!         sparse/cameras.txt, images.txt                    COLMAP's text model: a camera per image
//!         segmentations/00000.png                           255 is the background, everything else the person
//!         4d_humans/sam_segmentations/*.png                 HUGS's masks: 255 is the person
//!         4d_humans/smpl_optimized_aligned_scale.npz        HUGS's poses: global_orient, body_pose, betas, transl, scale
//!         smpl_output_optimized.pkl, alignments.npy         NeuMan's poses, and what leads from them into the scene
//! ```
//! Frame i is the i-th registered image in the order of names; rows of poses and sorted masks belong to it. HUGS's files are
//! taken where they are, and then as HUGS takes them: `X = scale LBS + transl`, cameras with a centred principal point. Else
//! NeuMan's: `X = [LBS, 1] A`, cameras as COLMAP has them. Both leave lens distortion out, and so does this.
//!
//! Without a split in the registry, frames are trained on and tested on as by HUGS: with L = int(1 / (N / 5) N), every L-th
//! frame from L / 2 on is held out, and the first half of those is tested on (what HUGS calls its val); the rest is left out.
//!
//! Layout and rules: `hugs/datasets/neuman.py` and `hugs/models/hugs_trimlp.py` of ml-hugs b65721a,
//! `data_io/{colmap_helper,neuman_helper}.py` of ml-neuman 0149d25.

use super::aligned;
use super::colmap::{self, Registered};
use super::{Layout, Part as Place, Request, Shared, split, triples};
use crate::folder::Subject;
use crate::models::{Doubt, Doubtful, Family, Gender, Models};
use crate::npz::Archive;
use crate::poses::{Part, PoseTrack};
use crate::{
    Capture, Error, FrameFiles, FrameRef, FrameSource, MaskFile, MaskReading, Sequence, Sourced, listing,
};
use skinsplat_core::scene::{Camera, Pose, RestBody};
use std::path::{Path, PathBuf};

pub(super) const LAYOUT: Layout = Layout {
    id: "neuman",
    summary: "NeuMan: images, COLMAP's text model in sparse, segmentations or HUGS's 4d_humans, poses of either",
    parts: &[
        Place::needed("images", "images/*.{png,jpg,jpeg}"),
        Place::needed("cameras", "sparse/cameras.txt").telling(),
        Place::needed("registered images", "sparse/images.txt").telling(),
        Place::needed("masks", "4d_humans/sam_segmentations/*.png").telling(),
        Place::needed("masks", "segmentations/*.{npy,png}").telling(),
        Place::needed("poses", "4d_humans/smpl_optimized_aligned_scale.npz")
            .of_arrays(&["betas", "global_orient", "body_pose", "transl", "scale"])
            .telling(),
        Place::needed("poses", "smpl_output_optimized.pkl").of_arrays(&["pose", "betas"]).telling(),
        Place::optional("alignments", "alignments.npy").telling(),
    ],
    load,
};

/// Loads the two sequences, `train` and `test`, of a scene.
///
/// # Errors
/// Missing or malformed files, poses or masks that do not match the registered images, too few frames to split.
fn load(request: &Request<'_>) -> Result<Subject, Error> {
    let folder = request.folder;
    let mut notes = Vec::new();
    let captures = captures(folder, &mut notes)?;
    let masks = masks(folder, &captures, &mut notes)?;
    let (train, test) = parts(request, captures.len())?;
    let poses_path = folder.join("4d_humans/smpl_optimized_aligned_scale.npz");
    let by_hugs = poses_path.is_file();
    let of_poses = |e: Error| e.about("poses");
    let mut bodies = match by_hugs {
        true => optimized(&poses_path, captures.len()),
        false => aligned::load(folder, &captures),
    }
    .map_err(of_poses)?;
    bodies.track.betas = betas_of(&bodies, train.first().copied().unwrap_or_default(), &mut notes);
    let mut models = Models::new(folder, request.options);
    let body = models.of_person(&bodies.path, Family::Smpl, Gender::Neutral, &bodies.track)?;
    notes.extend_from_slice(models.notes());
    let poses = bodies.poses(&body).map_err(of_poses)?;
    let cameras: Vec<Camera> = captures.iter().map(|c| camera(c, by_hugs)).collect();
    let doubts: Vec<Doubt> = centring(&captures, by_hugs).into_iter().chain(left_out(&captures)).collect();
    notes.extend(doubts.iter().map(|doubt| doubt.note.clone()));
    if !by_hugs {
        notes.push(
            "poses of smpl_output_optimized.pkl and alignments.npy: HUGS's 4d_humans is not here".into(),
        );
    }
    let shared = Shared { body, poses, cameras: cameras.into() };
    let scene = Scene { folder, captures, masks, shared };
    let sequences = [("train", train), ("test", test)].map(|(id, frames)| vec![scene.sequence(id, &frames)]);
    let [train, test] = sequences;
    let subject = request.subject(Capture::Monocular, train, test, notes);
    Ok(models.told(Subject { doubts, ..subject }))
}

/// Shapes and poses of all frames.
#[derive(Debug)]
pub(super) struct Bodies {
    pub(super) path: PathBuf,
    /// One row per frame, or one for all.
    pub(super) betas: Vec<Vec<f64>>,
    pub(super) track: PoseTrack,
    /// What leads the poses into the scene, if they are not in it.
    pub(super) places: Option<aligned::Places>,
}

impl Bodies {
    fn poses(&self, body: &RestBody) -> Result<Sourced<Vec<Pose>>, Error> {
        let poses = self.track.poses(&body.skeleton)?;
        match &self.places {
            None => Ok(poses),
            Some(places) => places.applied(&poses, &body.skeleton),
        }
    }
}

/// What the sequences share.
struct Scene<'a> {
    folder: &'a Path,
    captures: Vec<Registered>,
    masks: Vec<MaskFile>,
    shared: Shared,
}

impl Scene<'_> {
    fn sequence(&self, id: &str, frames: &[usize]) -> Sequence {
        let frame = |&i: &usize| FrameRef {
            name: self.captures[i]
                .name
                .rsplit_once('.')
                .map_or(&*self.captures[i].name, |(stem, _)| stem)
                .into(),
            time: i,
            pose: i,
            camera: i,
            source: FrameSource::Files(FrameFiles {
                image: self.folder.join("images").join(&self.captures[i].name),
                mask: Some(self.masks[i].clone()),
                background: None,
            }),
        };
        self.shared.sequence(id, frames.iter().map(frame).collect())
    }
}

/// The registered images in the order of their names. The authors sort as text: names for which numbers say otherwise are
/// refused, since nobody knows which order the rows of poses have.
fn captures(folder: &Path, notes: &mut Vec<String>) -> Result<Vec<Registered>, Error> {
    let sparse = folder.join("sparse");
    let mut captures = colmap::load(&sparse)?;
    captures.sort_by(|a, b| a.name.cmp(&b.name));
    if let Some(pair) =
        captures.windows(2).find(|pair| listing::natural_order(&pair[0].name, &pair[1].name).is_gt())
    {
        let problem = format!("{} sorts before {}", pair[0].name, pair[1].name);
        let expected = "numbers of one width, as 00009.png and 00010.png";
        return Err(Error::invalid(sparse.join("images.txt"), "image names", problem, expected));
    }
    let images = folder.join("images");
    let present = listing::files(&images, "images", &["png", "jpg", "jpeg"])?;
    let there = |name: &str| listing::stays_inside(name, 0) && images.join(name).is_file();
    if let Some(missing) = captures.iter().find(|capture| !there(&capture.name)) {
        let problem = format!("no file {}", missing.name);
        return Err(Error::invalid(images, "images", problem, "the registered images of sparse/images.txt"));
    }
    if present.len() > captures.len() {
        let extra = present.len() - captures.len();
        notes.push(format!(
            "{extra} of {} images are not registered in sparse/images.txt: left out",
            present.len()
        ));
    }
    Ok(captures)
}

/// The mask of each capture: HUGS's if they are there, else NeuMan's. They are paired by name if every capture has a
/// namesake, else by order.
fn masks(folder: &Path, captures: &[Registered], notes: &mut Vec<String>) -> Result<Vec<MaskFile>, Error> {
    let sam = folder.join("4d_humans/sam_segmentations");
    let by_hugs = sam.is_dir();
    let (place, reading) = match by_hugs {
        true => (sam, MaskReading::Coverage),
        false => (folder.join("segmentations"), MaskReading::NotBackground),
    };
    let found = listing::files(&place, "masks", if by_hugs { &["png"] } else { &["npy", "png"] })?;
    let mask = |path: &PathBuf| MaskFile { path: path.clone(), reading };
    let namesake = |capture: &Registered| {
        let stem = listing::stem(Path::new(&capture.name));
        // NeuMan's own masks may also be called 00000.png.npy.
        found.iter().find(|path| {
            let own = listing::stem(path);
            own == stem || own == capture.name
        })
    };
    if let Some(paths) = captures.iter().map(namesake).collect::<Option<Vec<_>>>() {
        return Ok(paths.into_iter().map(mask).collect());
    }
    if found.len() != captures.len() {
        let expected = format!("{}, one per registered image", captures.len());
        return Err(Error::invalid(place, "masks", format!("{} files", found.len()), expected));
    }
    notes.push(format!(
        "masks of {} are called otherwise than the images: paired by order",
        listing::file_name(&place)
    ));
    Ok(found.iter().map(mask).collect())
}

/// HUGS's poses.
fn optimized(path: &Path, frames: usize) -> Result<Bodies, Error> {
    let mut archive = Archive::open(path, "poses")?;
    let betas = match archive.header("betas")?.shape.len() {
        1 => archive.require("betas", "*")?,
        _ => archive.require("betas", "*,*")?,
    };
    let (rows, columns) = match betas.shape[..] {
        [rows, columns] => (rows, columns),
        _ => (1, betas.values.len()),
    };
    let orient = archive.require("global_orient", "N,3")?;
    if orient.shape[0] != frames {
        let problem = format!("{} poses", orient.shape[0]);
        return Err(archive.invalid("global_orient", problem, format!("{frames}, one per registered image")));
    }
    let body_pose = archive.require("body_pose", "N,*")?;
    let width = body_pose.shape[1];
    if width != 69 && width != 63 {
        return Err(archive.invalid("body_pose", format!("{width} values per frame"), "69 (SMPL)"));
    }
    let translations = triples(&archive.require("transl", "N,3")?.values);
    let pattern = if archive.header("scale")?.shape.len() == 2 { "N,1" } else { "N" };
    let scale = archive.require("scale", pattern)?;
    if ![1, frames].contains(&rows) {
        return Err(archive.invalid("betas", format!("{rows} rows"), format!("1 or {frames}")));
    }
    let parts = vec![(Part::GlobalOrient, orient.values), (Part::BodyPose, body_pose.values)];
    Ok(Bodies {
        path: path.to_owned(),
        betas: betas.values.chunks_exact(columns.max(1)).map(<[f64]>::to_vec).collect(),
        track: PoseTrack::from_parts(path, Vec::new(), parts, translations)?.with_scales(&scale.values)?,
        places: None,
    })
}

/// The shape: HUGS starts from that of the first training frame.
fn betas_of(bodies: &Bodies, first: usize, notes: &mut Vec<String>) -> Vec<f64> {
    let betas = bodies.betas.get(first).or(bodies.betas.first()).cloned().unwrap_or_default();
    if bodies.betas.iter().any(|row| *row != betas) {
        notes.push("betas differ from frame to frame: those of the first training frame for all".to_owned());
    }
    betas
}

/// A camera as HUGS projects, with fields of view only, or as NeuMan does.
fn camera(capture: &Registered, centred: bool) -> Camera {
    let camera = capture.camera.clone();
    if !centred {
        return camera;
    }
    let (cx, cy) = (f64::from(camera.width) / 2.0, f64::from(camera.height) / 2.0);
    Camera { cx, cy, ..camera }
}

/// What is said of principal points that are put into the centre.
fn centring(captures: &[Registered], centred: bool) -> Option<Doubt> {
    let off = |c: &Registered| {
        let (x, y) =
            (c.camera.cx - f64::from(c.camera.width) / 2.0, c.camera.cy - f64::from(c.camera.height) / 2.0);
        x.abs().max(y.abs())
    };
    let farthest = captures.iter().map(off).fold(0.0, f64::max);
    let note = format!("principal points are put into the centre, as by HUGS: {farthest:.2} pixels away");
    (centred && farthest > 0.01).then_some(Doubt { about: Doubtful::Camera, note })
}

/// What is said of distortion.
fn left_out(captures: &[Registered]) -> Option<Doubt> {
    let note = || "the cameras' distortion is left out, as by NeuMan and HUGS".to_owned();
    let distorted = captures.iter().any(|capture| capture.distorted);
    distorted.then(|| Doubt { about: Doubtful::Camera, note: note() })
}

/// Frames to train on and to test on.
fn parts(request: &Request<'_>, frames: usize) -> Result<(Vec<usize>, Vec<usize>), Error> {
    if let Some(own) = request.split {
        let chosen = |part, range| split::chosen(request.folder, part, range, frames);
        return Ok((chosen("train", own.train)?, chosen("test", own.test)?));
    }
    hugs_split(frames).ok_or_else(|| {
        let expected = "at least 10, or splits.<subject> = { train = [first, last, step], test = ... }";
        Error::invalid(request.folder, "images", format!("{frames} registered"), expected)
    })
}

/// HUGS's frames for training and its test list, in the float arithmetic of its authors; none if a list is empty.
fn hugs_split(frames: usize) -> Option<(Vec<usize>, Vec<usize>)> {
    let held = frames / 5;
    if held == 0 {
        return None;
    }
    let length = (1.0 / held as f64 * frames as f64) as usize;
    let held_out: Vec<usize> = (length / 2..frames).step_by(length.max(1)).collect();
    let test = held_out[..held_out.len() / 2].to_vec();
    let train: Vec<usize> = (0..frames).filter(|frame| !held_out.contains(frame)).collect();
    (!train.is_empty() && !test.is_empty()).then_some((train, test))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `get_data_splits` of ml-hugs, run in Python.
    #[test]
    fn frames_are_split_as_by_hugs() {
        for (frames, test) in [
            (20, vec![2, 7]),
            (41, vec![2, 7, 12, 17]),
            (42, vec![2, 7, 12, 17]),
            (103, vec![2, 7, 12, 17, 22, 27, 32, 37, 42, 47]),
            (10, vec![2]),
        ] {
            let (train, found) = hugs_split(frames).unwrap();
            assert_eq!(found, test, "{frames}");
            assert!(train.iter().all(|frame| frame % 5 != 2), "{frames}");
        }
        assert_eq!(hugs_split(20).unwrap().0.len(), 16);
        assert!(hugs_split(4).is_none() && hugs_split(5).is_none());
    }
}
