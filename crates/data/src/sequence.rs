//! A sequence of posed frames: everything an evaluation needs, with images decoded only when asked for.

use super::masks::MaskFile;
use super::{Error, Sourced, digest, frames, reduce};
use rayon::prelude::*;
use skinsplat_core::scene::{Camera, Image, Mask, Pose, RestBody};
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Frames of one subject.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// Name of the sequence ("test_twist").
    pub id: String,
    /// The subject's body in its rest pose.
    pub body: Arc<RestBody>,
    /// Poses that frames refer to.
    pub poses: Sourced<Vec<Pose>>,
    /// Cameras that frames refer to.
    pub cameras: Sourced<Vec<Camera>>,
    /// The frames, in order.
    pub frames: Vec<FrameRef>,
    /// Sizes of the images as stored, width and height per camera, where [`Sequence::reduced`] made the cameras smaller.
    pub stored_sizes: Option<Vec<[u32; 2]>>,
}

/// One image of a sequence.
#[derive(Clone, Debug)]
pub struct FrameRef {
    /// The image's own name ("cam00/image_0004"), unique in its sequence.
    pub name: String,
    /// Point in time, as the data numbers them: what the ranges of a split count.
    pub time: usize,
    /// Index into [`Sequence::poses`].
    pub pose: usize,
    /// Index into [`Sequence::cameras`].
    pub camera: usize,
    /// Where the image comes from.
    pub source: FrameSource,
}

/// Where the truth of a frame comes from.
#[derive(Clone, Debug)]
pub enum FrameSource {
    /// Files, decoded when asked for.
    Files(FrameFiles),
    /// Made when asked for: rendered, or computed from files that are no image each.
    Generated {
        /// What makes it.
        generator: Arc<dyn FrameGenerator>,
        /// Which of the generator's frames it is.
        frame: usize,
    },
}

/// The files of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameFiles {
    /// The image.
    pub image: PathBuf,
    /// Its mask; without one, the image's alpha channel is the mask.
    pub mask: Option<MaskFile>,
    /// What the camera sees without the subject. An image that has one keeps it, and renders are drawn over it.
    pub background: Option<PathBuf>,
}

/// Something that makes true frames: a renderer, or a reader of files that are no image each.
pub trait FrameGenerator: Send + Sync + Debug {
    /// The truth of a frame; the same bits at every call.
    ///
    /// # Errors
    /// If it is made from files that cannot be read.
    fn truth(&self, frame: usize) -> Result<Truth, Error>;

    /// A text that changes whenever any frame would.
    ///
    /// # Errors
    /// As [`FrameGenerator::truth`].
    fn key(&self) -> Result<String, Error>;
}

/// A true image: straight (un-premultiplied) colour, and how much of each pixel the subject covers.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Colour, sRGB values. Where the background was captured too, the whole picture.
    pub rgb: Image,
    /// Coverage in \[0, 1\].
    pub alpha: Mask,
    /// What the camera sees without the subject, if that was captured.
    pub background: Option<Image>,
}

impl Truth {
    /// A truth without a captured background.
    pub fn new(rgb: Image, alpha: Mask) -> Self {
        Self { rgb, alpha, background: None }
    }

    /// The truth at another, not larger, width and height, by area averages.
    pub fn reduced(self, [width, height]: [u32; 2]) -> Self {
        let (width, height) = (width as usize, height as usize);
        match (self.rgb.width(), self.rgb.height()) == (width, height) {
            true => self,
            false => reduce::reduced(&self, width, height),
        }
    }
}

/// True images that were loaded before.
#[derive(Debug)]
struct Held {
    truths: Vec<Truth>,
    /// Digest of them all, once it was asked for.
    key: OnceLock<String>,
}

impl FrameGenerator for Held {
    fn truth(&self, frame: usize) -> Result<Truth, Error> {
        Ok(self.truths[frame].clone())
    }

    fn key(&self) -> Result<String, Error> {
        Ok(self.key.get_or_init(|| format!("in memory {}", digest::of_truths(&self.truths))).clone())
    }
}

impl Sequence {
    /// The sequence with all its true images loaded, for those who look at them again and again.
    ///
    /// # Errors
    /// As [`Sequence::truth`].
    pub fn held(&self) -> Result<Self, Error> {
        let frames = (0..self.frames.len()).into_par_iter();
        let truths = frames.map(|frame| self.truth(frame)).collect::<Result<Vec<_>, Error>>()?;
        let generator: Arc<dyn FrameGenerator> = Arc::new(Held { truths, key: OnceLock::new() });
        let held = |(index, frame): (usize, &FrameRef)| FrameRef {
            source: FrameSource::Generated { generator: generator.clone(), frame: index },
            ..frame.clone()
        };
        let frames = self.frames.iter().enumerate().map(held).collect();
        Ok(Self { frames, stored_sizes: None, ..self.clone() })
    }

    /// The sequence seen by cameras whose longer side is at most `longer_side` pixels; true images are reduced by area
    /// averages when they are loaded.
    pub fn reduced(&self, longer_side: u32) -> Self {
        let stored = |camera: &Camera| [camera.width, camera.height];
        let stored_sizes =
            self.stored_sizes.clone().unwrap_or_else(|| self.cameras.iter().map(stored).collect());
        let reduced = |camera: &Camera| {
            let side = camera.width.max(camera.height);
            let shrunk = |size: u32| {
                (u64::from(size) * u64::from(longer_side)).div_ceil(u64::from(side)).max(1) as u32
            };
            if side <= longer_side {
                camera.clone()
            } else {
                camera.resized(shrunk(camera.width), shrunk(camera.height))
            }
        };
        let reduced: Vec<Camera> = self.cameras.iter().map(reduced).collect();
        let same = reduced == *self.cameras;
        let cameras =
            if same { self.cameras.clone() } else { self.cameras.derived(reduced, u64::from(longer_side)) };
        Self { cameras, stored_sizes: Some(stored_sizes), ..self.clone() }
    }

    /// The sequence with only the frames of these indices, in this order.
    ///
    /// # Errors
    /// An index out of range.
    pub fn selected(&self, frames: &[usize]) -> Result<Self, Error> {
        let frame = |&i: &usize| {
            let expected = || format!("a frame below {}", self.frames.len());
            self.frames
                .get(i)
                .cloned()
                .ok_or_else(|| Error::invalid(&self.id, "frame", i.to_string(), expected()))
        };
        Ok(Self { frames: frames.iter().map(frame).collect::<Result<_, _>>()?, ..self.clone() })
    }

    /// Several takes of one subject as one sequence, in this order, which keeps the first one's id. Frames carry the id of their
    /// take before their name.
    ///
    /// # Errors
    /// No take; takes on other bodies, since an avatar hangs on one.
    pub fn joined(takes: &[Self]) -> Result<Self, Error> {
        let [first, others @ ..] = takes else {
            return Err(Error::invalid("takes", "sequences", "none", "at least one"));
        };
        if let Some(other) = others.iter().find(|take| *take.body != *first.body) {
            let problem = format!("it has another body than {}", first.id);
            return Err(Error::invalid(&other.id, "body", problem, "takes of one subject on one body"));
        }
        if others.is_empty() {
            return Ok(first.clone());
        }
        let (mut poses, mut cameras, mut frames, mut stored) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for take in takes {
            let moved = |frame: &FrameRef| FrameRef {
                name: format!("{}/{}", take.id, frame.name),
                pose: frame.pose + poses.len(),
                camera: frame.camera + cameras.len(),
                ..frame.clone()
            };
            frames.extend(take.frames.iter().map(moved));
            stored.extend((0..take.cameras.len()).map(|camera| take.stored_size(camera)));
            poses.extend(take.poses.iter().cloned());
            cameras.extend(take.cameras.iter().cloned());
        }
        let (id, body) = (first.id.clone(), first.body.clone());
        Ok(Self {
            id,
            body,
            poses: poses.into(),
            cameras: cameras.into(),
            frames,
            stored_sizes: Some(stored),
        })
    }

    /// The true image of a frame, of the size of its camera.
    ///
    /// # Errors
    /// A frame that is missing or unreadable, an image or mask of another size than the camera.
    pub fn truth(&self, frame: usize) -> Result<Truth, Error> {
        let Some(FrameRef { camera, source, .. }) = self.frames.get(frame) else {
            let expected = format!("a frame below {}", self.frames.len());
            return Err(Error::invalid(&self.id, "frame", frame.to_string(), expected));
        };
        let wanted = &self.cameras[*camera];
        let stored = self.stored_size(*camera);
        Ok(self.stored_truth(source, stored)?.reduced([wanted.width, wanted.height]))
    }

    /// The frame before a frame: the latest earlier one that the same camera took (one that stands and looks the same, if each
    /// frame has its own), the first listed of several. None for the first, and where the camera moves.
    pub fn before(&self, frame: usize) -> Option<usize> {
        let FrameRef { time, camera, .. } = self.frames.get(frame)?;
        let same = |other: usize| other == *camera || self.cameras[other] == self.cameras[*camera];
        let earlier = self.frames.iter().enumerate().filter(|(_, other)| other.time < *time);
        // Of equal times `max_by_key` takes the last.
        let latest =
            earlier.rev().filter(|(_, other)| same(other.camera)).max_by_key(|(_, other)| other.time);
        latest.map(|(index, _)| index)
    }

    /// Width and height of the images of a camera as they are stored.
    pub fn stored_size(&self, camera: usize) -> [u32; 2] {
        let seen = || [self.cameras[camera].width, self.cameras[camera].height];
        self.stored_sizes.as_ref().map_or_else(seen, |sizes| sizes[camera])
    }

    /// A true image at the size at which it is stored.
    fn stored_truth(&self, source: &FrameSource, [width, height]: [u32; 2]) -> Result<Truth, Error> {
        match source {
            FrameSource::Generated { generator, frame } => generator.truth(*frame),
            FrameSource::Files(files) => files.truth((width as usize, height as usize)),
        }
    }
}

impl FrameFiles {
    fn truth(&self, size: (usize, usize)) -> Result<Truth, Error> {
        let (rgb, own_alpha) = frames::load_image(&self.image).map_err(|e| e.about("image"))?;
        check_size(&self.image, "image", (rgb.width(), rgb.height()), size)?;
        let alpha = match &self.mask {
            Some(file) => {
                let mask = file.load(&rgb).map_err(|e| e.about("mask"))?;
                check_size(&file.path, "mask", (mask.width(), mask.height()), size)?;
                mask
            }
            None => own_alpha.unwrap_or_else(|| Mask::filled(size.0, size.1, 1.0)),
        };
        let background = self.background.as_ref().map(|path| {
            let (image, _) = frames::load_image(path)?;
            check_size(path, "background", (image.width(), image.height()), size)?;
            Ok::<_, Error>(image)
        });
        Ok(Truth { rgb, alpha, background: background.transpose()? })
    }

    /// Every file, the image first.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        let mask = self.mask.as_ref().map(|mask| mask.path.as_path());
        std::iter::once(self.image.as_path()).chain(mask).chain(self.background.as_deref())
    }
}

fn check_size(path: &Path, field: &str, found: (usize, usize), camera: (usize, usize)) -> Result<(), Error> {
    if found == camera {
        return Ok(());
    }
    let expected = format!("the camera's {}x{}", camera.0, camera.1);
    Err(Error::invalid(path, format!("{field} size"), format!("{}x{}", found.0, found.1), expected))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat4, DVec3};
    use skinsplat_core::scene::{Skeleton, SkinWeights};

    /// Frames of times and cameras. The cameras 0 and 2 are equal.
    fn sequence(frames: &[(usize, usize)]) -> Sequence {
        let names = vec!["root".to_owned()];
        let skeleton = Skeleton::from_joint_positions(names, vec![None], &[DVec3::ZERO]).unwrap();
        let rest = Pose::rest(&skeleton);
        let weights = SkinWeights::from_rows([[(0, 1.0)]], 1).unwrap();
        let (vertices, faces) = (vec![DVec3::X], Vec::new());
        let body = RestBody { skeleton, vertices, faces, weights, uv: None, pose_directions: Vec::new() };
        let camera = |cx: f64| Camera {
            width: 8,
            height: 4,
            fx: 9.0,
            fy: 9.0,
            cx,
            cy: 2.0,
            camera_from_world: DMat4::IDENTITY,
        };
        let source = |image: String| {
            FrameSource::Files(FrameFiles { image: image.into(), mask: None, background: None })
        };
        let frame = |&(time, camera): &(usize, usize)| {
            let name = format!("{camera}/{time}");
            FrameRef { source: source(name.clone()), name, time, pose: 0, camera }
        };
        Sequence {
            id: "test".into(),
            body: Arc::new(body),
            poses: vec![rest].into(),
            cameras: [4.0, 3.0, 4.0].map(camera).to_vec().into(),
            frames: frames.iter().map(frame).collect(),
            stored_sizes: None,
        }
    }

    #[test]
    fn the_frame_before_is_the_latest_earlier_one_of_the_camera() {
        let before = |frames: &[(usize, usize)]| {
            let sequence = sequence(frames);
            (0..frames.len()).map(|frame| sequence.before(frame)).collect::<Vec<_>>()
        };
        let by_time = before(&[(0, 0), (0, 1), (4, 0), (4, 1), (5, 1)]);
        assert_eq!(by_time, [None, None, Some(0), Some(1), Some(3)]);
        assert_eq!(before(&[(7, 0), (3, 0), (5, 0), (5, 0)]), [Some(2), None, Some(1), Some(1)], "any order");
        assert_eq!(
            before(&[(0, 0), (1, 1), (2, 2)]),
            [None, None, Some(0)],
            "a camera that moved, one that did not"
        );
        assert_eq!(sequence(&[]).before(0), None);
    }
}
