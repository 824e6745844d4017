//! A sequence of posed frames: everything an evaluation needs, with images decoded only when asked for.

use super::{Error, Sourced, digest, frames, reduce};
use rayon::prelude::*;
use skinsplat_core::scene::{Camera, Image, Mask, Pose, RestBody};
use std::fmt::Debug;
use std::path::PathBuf;
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
    /// Files, decoded when asked for. Without a mask file, the image's alpha channel is the mask.
    Files {
        /// The image.
        image: PathBuf,
        /// Its mask.
        mask: Option<PathBuf>,
    },
    /// Rendered when asked for.
    Generated {
        /// What renders it.
        generator: Arc<dyn FrameGenerator>,
        /// Which of the generator's frames it is.
        frame: usize,
    },
}

/// Something that makes true frames in-process.
pub trait FrameGenerator: Send + Sync + Debug {
    /// The truth of a frame; the same bits at every call.
    fn truth(&self, frame: usize) -> Truth;

    /// A text that changes whenever any frame would.
    fn key(&self) -> String;
}

/// A true image: straight (un-premultiplied) colour, and how much of each pixel the subject covers.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Colour, sRGB values.
    pub rgb: Image,
    /// Coverage in \[0, 1\].
    pub alpha: Mask,
}

/// True images that were loaded before.
#[derive(Debug)]
struct Held {
    truths: Vec<Truth>,
    /// Digest of them all, once it was asked for.
    key: OnceLock<String>,
}

impl FrameGenerator for Held {
    fn truth(&self, frame: usize) -> Truth {
        self.truths[frame].clone()
    }

    fn key(&self) -> String {
        self.key.get_or_init(|| format!("in memory {}", digest::of_truths(&self.truths))).clone()
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
        let stored = self.stored_sizes.as_ref().map_or([wanted.width, wanted.height], |sizes| sizes[*camera]);
        let truth = self.stored_truth(source, stored)?;
        if stored == [wanted.width, wanted.height] {
            return Ok(truth);
        }
        Ok(reduce::reduced(&truth, wanted.width as usize, wanted.height as usize))
    }

    /// A true image at the size at which it is stored.
    fn stored_truth(&self, source: &FrameSource, [width, height]: [u32; 2]) -> Result<Truth, Error> {
        match source {
            FrameSource::Generated { generator, frame } => Ok(generator.truth(*frame)),
            FrameSource::Files { image, mask } => {
                let size = (width as usize, height as usize);
                let (rgb, own_alpha) = frames::load_image(image)?;
                check_size(image, "image", (rgb.width(), rgb.height()), size)?;
                let alpha = match mask {
                    Some(path) => {
                        let mask = frames::load_mask(path)?;
                        check_size(path, "mask", (mask.width(), mask.height()), size)?;
                        mask
                    }
                    None => own_alpha.unwrap_or_else(|| Mask::filled(size.0, size.1, 1.0)),
                };
                Ok(Truth { rgb, alpha })
            }
        }
    }
}

fn check_size(
    path: &std::path::Path,
    field: &str,
    found: (usize, usize),
    camera: (usize, usize),
) -> Result<(), Error> {
    if found == camera {
        return Ok(());
    }
    let expected = format!("the camera's {}x{}", camera.0, camera.1);
    Err(Error::invalid(path, format!("{field} size"), format!("{}x{}", found.0, found.1), expected))
}
