//! What is measured on.

use crate::trade::Error;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{Avatar, Camera, SceneError};
use skinsplat_data::Sequence;
use skinsplat_fit::options::Clothing;
use skinsplat_fit::surface::{SurfaceInit, surface_init};
use skinsplat_synthetic::SUBJECTS;

/// How much is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Subject among those that are built in.
    pub subject: String,
    /// Longer side of the images, pixels.
    pub resolution: u32,
    /// Longest edge of the avatar's mesh, metres: its Gaussians.
    pub edge: f64,
    /// Poses of the test motion.
    pub poses: usize,
    /// Repetitions.
    pub runs: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { subject: "stripes".to_owned(), resolution: 512, edge: 0.01, poses: 4, runs: 5 }
    }
}

/// Training frames that the avatar is made from.
const TRAINING_FRAMES: usize = 4;

/// An avatar with SH of degree 3, a motion and a camera.
pub(super) struct Scene {
    pub(super) avatar: Avatar,
    /// The test motion, at the resolution asked for.
    pub(super) test: Sequence,
    /// Indices of the frames to look at.
    pub(super) frames: Vec<usize>,
    /// A camera that sees the middle of the body and nothing else.
    pub(super) close: Camera,
}

impl Scene {
    pub(super) fn new(options: &Options) -> Result<Self, Error> {
        let mut known = skinsplat_synthetic::subjects(SUBJECTS)?;
        let Some(parameters) = known.remove(&options.subject) else {
            let known: Vec<String> = known.into_keys().collect();
            return Err(
                SceneError::new("subject", &options.subject, format!("one of {}", known.join(", "))).into()
            );
        };
        let subject = skinsplat_synthetic::Subject::new(&parameters)?;
        let (train, test) = (subject.train(), subject.test());
        let (Some(train), Some(test)) = (train.first(), test.first()) else {
            return Err(
                SceneError::new("subject", "no sequence", "one to train on and one to test on").into()
            );
        };
        let chosen = spread(train.frames.len(), TRAINING_FRAMES);
        let train = train.selected(&chosen)?.reduced(256);
        let init = SurfaceInit {
            sh_degree: sh::MAX_DEGREE,
            longest_edge: options.edge,
            clothing: Clothing { rounds: 0, ..Clothing::default() },
            refinements: 0,
            ..SurfaceInit::default()
        };
        let avatar = surface_init(&train, &init)?;
        let test = test.reduced(options.resolution);
        let frames = spread(test.frames.len(), options.poses);
        let Some(first) = frames.first() else {
            return Err(SceneError::new("poses", "0", "at least 1").into());
        };
        let camera = &test.cameras[test.frames[*first].camera];
        let close = Camera { fx: camera.fx * 4.0, fy: camera.fy * 4.0, ..camera.clone() };
        Ok(Self { avatar, frames, close, test })
    }
}

/// At most `most` indices, evenly spread.
fn spread(n: usize, most: usize) -> Vec<usize> {
    let count = most.min(n);
    (0..count).map(|i| i * n / count).collect()
}
