//! A sequence of posed frames: everything an evaluation needs, with images decoded only when asked for.

use super::{Error, frames};
use crate::scene::{Camera, Image, Mask, Pose, RestBody};
use sha2::{Digest, Sha256};
use std::fmt::Debug;
use std::path::PathBuf;
use std::sync::Arc;

/// Frames of one subject.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// Name of the sequence ("test_twist").
    pub id: String,
    /// The subject's body in its rest pose.
    pub body: Arc<RestBody>,
    /// Poses that frames refer to.
    pub poses: Vec<Pose>,
    /// Cameras that frames refer to.
    pub cameras: Vec<Camera>,
    /// The frames, in order.
    pub frames: Vec<FrameRef>,
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

impl Sequence {
    /// The true image of a frame, of the size of its camera.
    ///
    /// # Errors
    /// A frame that is missing or unreadable, an image or mask of another size than the camera.
    pub fn truth(&self, frame: usize) -> Result<Truth, Error> {
        let Some(FrameRef { camera, source, .. }) = self.frames.get(frame) else {
            let expected = format!("a frame below {}", self.frames.len());
            return Err(Error::invalid(&self.id, "frame", frame.to_string(), expected));
        };
        match source {
            FrameSource::Generated { generator, frame } => Ok(generator.truth(*frame)),
            FrameSource::Files { image, mask } => {
                let camera = &self.cameras[*camera];
                let size = (camera.width as usize, camera.height as usize);
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

    /// A content key of a frame's truth: SHA-256 of its files, or of the generator's key and the frame number.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn truth_digest(&self, frame: &FrameRef) -> Result<String, Error> {
        let mut hash = Sha256::new();
        match &frame.source {
            FrameSource::Generated { generator, frame } => {
                hash.update(format!("generated {frame} of {}", generator.key()));
            }
            FrameSource::Files { image, mask } => {
                for (kind, path) in [("image", Some(image)), ("mask", mask.as_ref())] {
                    let Some(path) = path else { continue };
                    let bytes = super::error::read_bytes(path, kind, "a frame of the sequence")?;
                    hash.update(format!("{kind} {} bytes\n", bytes.len()));
                    hash.update(bytes);
                }
            }
        }
        Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
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
