//! Masks as data sets store them: which values mean the person.

use super::{Error, frames};
use skinsplat_core::scene::{Image, Mask};
use std::path::PathBuf;

/// A mask and how it is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskFile {
    /// The file.
    pub path: PathBuf,
    /// What its values mean.
    pub reading: MaskReading,
}

/// What the values of a mask mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MaskReading {
    /// How much of a pixel the person covers, as by [`frames::load_mask`].
    #[default]
    Coverage,
    /// The highest value is the background and every other one the person, as in NeuMan's `segmentations`.
    NotBackground,
    /// The file is what the camera sees without the person, who is where the image differs from it: in one channel by more
    /// than [`MaskReading::DIFFERENCE`] (GalaBasketball).
    Differs,
}

impl From<PathBuf> for MaskFile {
    fn from(path: PathBuf) -> Self {
        Self { path, reading: MaskReading::default() }
    }
}

impl MaskReading {
    /// How far the values of a background may be from those of the image: 4 of 255 levels, and half of one for rounding.
    pub const DIFFERENCE: f32 = 4.5 / 255.0;

    /// Its name in digests; none for the plain reading.
    pub(super) fn name(self) -> Option<&'static str> {
        match self {
            Self::Coverage => None,
            Self::NotBackground => Some("not background"),
            Self::Differs => Some("differs by more than 4/255"),
        }
    }
}

impl MaskFile {
    /// The mask of an image, values in \[0, 1\].
    ///
    /// # Errors
    /// As [`frames::load_mask`]; a mask of [`MaskReading::NotBackground`] whose highest value is not the highest that its
    /// file can hold, a background of another size than the image.
    pub fn load(&self, image: &Image) -> Result<Mask, Error> {
        match self.reading {
            MaskReading::Coverage => frames::load_mask(&self.path),
            MaskReading::NotBackground => self.not_background(),
            MaskReading::Differs => self.differs(image),
        }
    }

    fn not_background(&self) -> Result<Mask, Error> {
        let stored = frames::load_mask(&self.path)?;
        if stored.values().iter().all(|&v| v < 1.0) {
            let problem = "no pixel has the highest value";
            return Err(Error::invalid(&self.path, "mask", problem, "255 where the background is"));
        }
        let person = |&v: &f32| f32::from(v < 1.0);
        let values = stored.values().iter().map(person).collect();
        Mask::new(stored.width(), stored.height(), values).map_err(|e| Error::scene(&self.path, e))
    }

    fn differs(&self, image: &Image) -> Result<Mask, Error> {
        let (behind, _) = frames::load_image(&self.path)?;
        let size = |image: &Image| (image.width(), image.height());
        if size(&behind) != size(image) {
            let problem = format!("{}x{}", behind.width(), behind.height());
            let expected = format!("the image's {}x{}", image.width(), image.height());
            return Err(Error::invalid(&self.path, "background size", problem, expected));
        }
        let far = |(a, b): (&f32, &f32)| (a - b).abs() > MaskReading::DIFFERENCE;
        let pixels = image.pixels().iter().zip(behind.pixels());
        let values = pixels.map(|(a, b)| f32::from(a.iter().zip(b).any(far))).collect();
        Mask::new(image.width(), image.height(), values).map_err(|e| Error::scene(&self.path, e))
    }
}
