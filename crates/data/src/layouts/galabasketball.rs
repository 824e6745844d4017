//! GalaBasketball, the data set of Animatable 3D Gaussian.
//!
//! ```text
//! <scene>/model/mesh.txt             5 lines per vertex: position, normal, texture coordinates, weights, joints
//!               tpose.txt            3 lines per joint: position relative to the parent, rotation, scale
//!               tpose_mat.txt        16 numbers per joint, row by row: joint from mesh in the rest pose
//!               jointParent.txt      a number per joint, -1 for the root
//!               weights.npy          (V, J)
//!         pose/0004.txt              3 lines per joint: position, Euler angles in degrees, scale
//!         camera/6.txt               field of view, width, height; position; quaternion x y z w; scale
//!         6/0004.png                 what camera 6 saw, background kept (0004_mask.png: its mask, used if there)
//!         bg/6.png                   what it sees without the player
//! ```
//! The world is mirrored to a right-handed one ([`unity`]). Rotations of a pose are R = Ry Rx Rz, absolute
//! (not relative to the rest pose); positions are those of `tpose.txt` but for the root, whose position is the pose's; scales are not used. A frame's
//! pose is that of the same number; every camera must have all frames that one has. Cameras 0 to 5 are for training, 6 for testing, at the same points in time; the index of a
//! camera is its number. The principal point is in the centre. Without masks the player is where the image differs from the
//! background ([`MaskReading::Differs`]). `mesh.txt` has no triangles: they are made from
//! neighbouring vertices ([`surface`]).
//!
//! Layout: `dataset/galaBasketball.py`, `deformer/gala_model.py` of Animatable-3D-Gaussian ee7318d.

use super::unity;
use super::{Layout, Part as Place, Request, split, surface};
use crate::digest::Fingerprint;
use crate::folder::Subject;
use crate::{
    Capture, Error, FrameFiles, FrameRef, FrameSource, MaskFile, MaskReading, Sequence, Sourced, listing, npy,
};
use glam::DVec3;
use skinsplat_core::scene::{Camera, LocalTransform, Pose, RestBody, Skeleton, SkinWeights};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(super) const LAYOUT: Layout = Layout {
    id: "galabasketball",
    summary: "GalaBasketball: model, pose, camera and bg of Unity's text files, a folder of images per camera",
    parts: &[
        Place::needed("mesh", "model/mesh.txt").telling(),
        Place::needed("rest pose", "model/tpose.txt").telling(),
        Place::needed("binding", "model/tpose_mat.txt").telling(),
        Place::needed("parents", "model/jointParent.txt").telling(),
        Place::needed("weights", "model/weights.npy").telling(),
        Place::needed("poses", "pose/*.txt").telling(),
        Place::needed("cameras", "camera/*.txt").telling(),
        Place::needed("images of camera 0", "0/*.{png,jpg}"),
        Place::needed("images of camera 1", "1/*.{png,jpg}"),
        Place::needed("images of camera 2", "2/*.{png,jpg}"),
        Place::needed("images of camera 3", "3/*.{png,jpg}"),
        Place::needed("images of camera 4", "4/*.{png,jpg}"),
        Place::needed("images of camera 5", "5/*.{png,jpg}"),
        Place::needed("images of camera 6", "6/*.{png,jpg}"),
        Place::optional("backgrounds", "bg/*.{png,jpg}"),
    ],
    load,
};

/// The cameras that are trained on, and the one that is tested on.
const TRAIN_CAMERAS: [usize; 6] = [0, 1, 2, 3, 4, 5];
const TEST_CAMERAS: [usize; 1] = [6];

/// Loads the two sequences, `train` and `test`, of a scene.
///
/// # Errors
/// Missing or malformed files, several players, images without a pose of their number.
fn load(request: &Request<'_>) -> Result<Subject, Error> {
    let folder = request.folder;
    let rig = Rig::load(&folder.join("model")).map_err(|e| e.about("body model"))?;
    let (times, poses) = poses(&folder.join("pose"), &rig).map_err(|e| e.about("poses"))?;
    let cameras: Sourced<Vec<Camera>> =
        cameras(&folder.join("camera")).map_err(|e| e.about("camera"))?.into();
    let images = TRAIN_CAMERAS
        .iter()
        .chain(&TEST_CAMERAS)
        .map(|&camera| Ok((camera, images(&folder.join(camera.to_string()))?)));
    let images = images.collect::<Result<_, Error>>()?;
    let scene = Scene { folder, body: Arc::new(rig.body), times, poses, cameras, images };
    let part = |id: &str, cameras: &[usize], range: Option<split::Range>| {
        Ok::<_, Error>(vec![scene.sequence(id, cameras, range)?])
    };
    let train = part("train", &TRAIN_CAMERAS, request.split.map(|split| split.train))?;
    let test = part("test", &TEST_CAMERAS, request.split.map(|split| split.test))?;
    let note = "mesh.txt has no triangles: those of neighbouring vertices are the body's surface";
    let notes = std::iter::once(note.to_owned()).chain(rig.repaired).collect();
    Ok(request.subject(Capture::Multiview, train, test, notes))
}

/// The body, and where its joints are relative to their parents.
struct Rig {
    body: RestBody,
    positions: Vec<DVec3>,
    /// What was done to its weights.
    repaired: Option<String>,
}

impl Rig {
    fn load(folder: &Path) -> Result<Self, Error> {
        let mesh = folder.join("mesh.txt");
        let lines = unity::groups(&mesh, "mesh", &[3, 3, 0, 0, 0])?;
        let [vertices, normals] =
            [0, 1].map(|line| lines.iter().map(|lines| unity::point(&lines[line])).collect::<Vec<_>>());
        let faces = surface::of_points(&vertices, &normals);
        let tpose = unity::groups(&folder.join("tpose.txt"), "joints", &[3, 0, 0])?;
        let positions: Vec<DVec3> = tpose.iter().map(|lines| unity::point(&lines[0])).collect();
        let joints = positions.len();
        let path = folder.join("tpose_mat.txt");
        let inverse_binds: Vec<_> =
            unity::groups(&path, "matrices", &[16])?.iter().map(|lines| unity::affine(&lines[0])).collect();
        if inverse_binds.len() != joints {
            let problem = format!("{} matrices", inverse_binds.len());
            return Err(Error::invalid(
                path,
                "matrices",
                problem,
                format!("{joints}, one per joint of tpose.txt"),
            ));
        }
        if let Some(j) = inverse_binds.iter().position(|bind| bind.matrix3.determinant() <= 0.0) {
            let problem = format!("determinant {:.3}", inverse_binds[j].matrix3.determinant());
            return Err(Error::invalid(
                path,
                format!("matrices[{j}]"),
                problem,
                "a rotation, perhaps with a scale: no joint mirrors or vanishes at rest",
            ));
        }
        let parents = parents(&folder.join("jointParent.txt"), joints)?;
        let (weights, repaired) = weights(&folder.join("weights.npy"), vertices.len(), joints)?;
        let bind = |j: usize| inverse_binds[j].inverse();
        let local = |(j, parent): (usize, &Option<usize>)| {
            let local = parent.map_or(bind(j), |p| inverse_binds[p] * bind(j));
            let (scale, rotation, translation) = local.to_scale_rotation_translation();
            LocalTransform { translation, rotation, scale }
        };
        let rest_locals = parents.iter().enumerate().map(local).collect();
        let names = (0..joints).map(|j| format!("joint {j}")).collect();
        let scene = |e| Error::scene(folder, e);
        let skeleton = Skeleton::new(names, parents, rest_locals, inverse_binds).map_err(scene)?;
        let body = RestBody { skeleton, vertices, faces, weights, uv: None, pose_directions: Vec::new() };
        body.validate().map_err(scene)?;
        Ok(Self { body, positions, repaired })
    }
}

fn parents(path: &Path, joints: usize) -> Result<Vec<Option<usize>>, Error> {
    let lines = unity::groups(path, "parents", &[1])?;
    if lines.len() != joints {
        let problem = format!("{} lines", lines.len());
        return Err(Error::invalid(
            path,
            "parents",
            problem,
            format!("{joints}, one per joint of tpose.txt"),
        ));
    }
    let parent = |(i, line): (usize, &Vec<Vec<f64>>)| match line[0][0] {
        -1.0 => Ok(None),
        p if p.fract() == 0.0 && p >= 0.0 && p < joints as f64 => Ok(Some(p as usize)),
        p => Err(Error::invalid(
            path,
            format!("line {}", i + 1),
            p.to_string(),
            format!("-1 or a joint below {joints}"),
        )),
    };
    lines.iter().enumerate().map(parent).collect()
}

/// The weights, and what was done to those that did not sum to one.
fn weights(path: &Path, vertices: usize, joints: usize) -> Result<(SkinWeights, Option<String>), Error> {
    let array = npy::read(path)?;
    if array.shape != [vertices, joints] {
        let expected = format!("({vertices}, {joints}): vertices of mesh.txt, joints of tpose.txt");
        return Err(Error::invalid(path, "weights", format!("shape {:?}", array.shape), expected));
    }
    let row = |row: &[f64]| row.iter().map(|&w| w as f32).enumerate().collect();
    let mut rows: Vec<Vec<(usize, f32)>> = array.values.chunks_exact(joints).map(row).collect();
    let repaired = SkinWeights::normalise(&mut rows).map(|what| format!("weights: {what}"));
    Ok((SkinWeights::from_rows(rows, joints).map_err(|e| Error::scene(path, e))?, repaired))
}

/// Poses, and the place of each by its point in time.
type Timed = (BTreeMap<usize, usize>, Sourced<Vec<Pose>>);

/// The poses and their place by point in time.
fn poses(folder: &Path, rig: &Rig) -> Result<Timed, Error> {
    let files = listing::numbered(folder, "poses", &["txt"])?;
    let mut hash = Fingerprint::new();
    let mut poses = Vec::new();
    for path in files.values() {
        let joints = unity::groups(path, "pose", &[3, 3, 0])?;
        let count = rig.positions.len();
        if joints.len() != count {
            let players = joints.len() / count.max(1);
            let what =
                if joints.len() == players * count { format!(", {players} players") } else { String::new() };
            let expected = format!("{count}, of one player");
            return Err(Error::invalid(path, "pose", format!("{} joints{what}", joints.len()), expected));
        }
        let local = |(j, lines): (usize, &Vec<Vec<f64>>)| {
            let root = rig.body.skeleton.parents[j].is_none();
            let translation = if root { unity::point(&lines[0]) } else { rig.positions[j] };
            LocalTransform { translation, rotation: unity::rotation(&lines[1]), scale: DVec3::ONE }
        };
        hash.count(count);
        rig.positions.iter().for_each(|p| hash.numbers(p.to_array()));
        joints.iter().for_each(|lines| hash.numbers(lines[0].iter().chain(&lines[1]).copied()));
        let locals = joints.iter().enumerate().map(local).collect();
        poses.push(Pose { locals, translation: DVec3::ZERO, blend_shape_rotations: None });
    }
    let times = files.keys().copied().enumerate().map(|(row, time)| (time, row)).collect();
    Ok((times, Sourced::computed(poses, hash.finish())))
}

/// No scene has more cameras than this.
const MAX_CAMERAS: usize = 4096;

/// The cameras by their number; one that is missing between others is like the one before it, and no frame is of it.
fn cameras(folder: &Path) -> Result<Vec<Camera>, Error> {
    let files = listing::numbered(folder, "cameras", &["txt"])?;
    let mut cameras: Vec<Camera> = Vec::new();
    for (&id, path) in &files {
        if id >= MAX_CAMERAS {
            return Err(Error::invalid(
                path,
                "cameras",
                format!("camera {id}"),
                format!("a number below {MAX_CAMERAS}"),
            ));
        }
        let camera = unity::camera(path)?;
        while cameras.len() < id {
            cameras.push(cameras.last().unwrap_or(&camera).clone());
        }
        cameras.push(camera);
    }
    Ok(cameras)
}

/// What the sequences share.
struct Scene<'a> {
    folder: &'a Path,
    body: Arc<RestBody>,
    /// Row of the poses by point in time.
    times: BTreeMap<usize, usize>,
    poses: Sourced<Vec<Pose>>,
    cameras: Sourced<Vec<Camera>>,
    /// Images by camera and point in time.
    images: BTreeMap<usize, BTreeMap<usize, PathBuf>>,
}

impl Scene<'_> {
    /// The frames of these cameras, in the order of time: of every point in time of which a camera of the scene has one, or of a range
    /// (last included).
    fn sequence(&self, id: &str, cameras: &[usize], range: Option<split::Range>) -> Result<Sequence, Error> {
        let count = self.times.keys().next_back().map_or(0, |last| last + 1);
        let times: BTreeSet<usize> = match range {
            None => self.images.values().flat_map(|images| images.keys().copied()).collect(),
            Some(range) => split::chosen(self.folder, id, range, count)?.into_iter().collect(),
        };
        let mut frames = Vec::new();
        for &camera in cameras {
            let background = self.background(id, camera)?;
            for &time in &times {
                frames.push(self.frame(camera, time, background.as_deref())?);
            }
        }
        frames.sort_by_key(|frame| (frame.time, frame.camera));
        Ok(Sequence {
            id: id.to_owned(),
            body: self.body.clone(),
            poses: self.poses.clone(),
            cameras: self.cameras.clone(),
            frames,
            stored_sizes: None,
        })
    }

    /// What a camera, which must be there, sees without the player; none if nobody captured it.
    fn background(&self, id: &str, camera: usize) -> Result<Option<PathBuf>, Error> {
        let file = self.folder.join(format!("camera/{camera}.txt"));
        if !file.is_file() {
            return Err(Error::invalid(
                file,
                "cameras",
                "missing",
                format!("the camera of the images of {id}"),
            ));
        }
        let places = ["png", "jpg"].map(|end| self.folder.join(format!("bg/{camera}.{end}")));
        Ok(places.into_iter().find(|path| path.is_file()))
    }

    fn frame(&self, camera: usize, time: usize, background: Option<&Path>) -> Result<FrameRef, Error> {
        let image = self.images.get(&camera).and_then(|images| images.get(&time)).ok_or_else(|| {
            let folder = self.folder.join(camera.to_string());
            Error::invalid(folder, "images", format!("frame {time} is missing"), format!("{time:04}.png"))
        })?;
        let pose = *self.times.get(&time).ok_or_else(|| {
            let place = self.folder.join("pose");
            Error::invalid(place, "poses", format!("none of frame {time}"), format!("{time:04}.txt"))
        })?;
        let own = image.with_file_name(format!("{}_mask.png", listing::stem(image)));
        let mask = match background {
            _ if own.is_file() => MaskFile::from(own),
            Some(background) => MaskFile { path: background.to_owned(), reading: MaskReading::Differs },
            None => {
                let place = self.folder.join(format!("bg/{camera}.png"));
                let expected =
                    format!("what the camera sees without the player, or {}", listing::file_name(&own));
                return Err(Error::invalid(place, "background", "missing", expected));
            }
        };
        let files =
            FrameFiles { image: image.clone(), mask: Some(mask), background: background.map(Path::to_owned) };
        let name = format!("{camera}/{}", listing::stem(image));
        Ok(FrameRef { name, time, pose, camera, source: FrameSource::Files(files) })
    }
}

/// The images of a camera by point in time: masks lie among them.
fn images(folder: &Path) -> Result<BTreeMap<usize, PathBuf>, Error> {
    let mut images = BTreeMap::new();
    for path in listing::files(folder, "images", &["png", "jpg"])? {
        if let Ok(time) = listing::stem(&path).parse::<usize>()
            && let Some(other) = images.insert(time, path.clone())
        {
            let problem = format!("frame {time} too, as {} is", listing::file_name(&other));
            return Err(Error::invalid(path, "images", problem, "one file of a number"));
        }
    }
    if images.is_empty() {
        return Err(Error::invalid(
            folder,
            "images",
            "no file",
            "images called 0000.png, 0002.png and so on",
        ));
    }
    Ok(images)
}
