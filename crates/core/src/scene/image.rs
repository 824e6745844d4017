//! Images: `f32` RGB sRGB values, row-major, and single-channel masks. Pixel (x, y) has its centre at (x + 0.5, y + 0.5).

use super::SceneError;

/// An RGB image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

/// A single-channel image (alpha, coverage, depth), same layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Image {
    /// An image from its pixels.
    ///
    /// # Errors
    /// If the count is not `width * height`.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>) -> Result<Self, SceneError> {
        check_count(width, height, pixels.len())?;
        Ok(Self { width, height, pixels })
    }

    /// An image of one colour.
    pub fn filled(width: usize, height: usize, colour: [f32; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// Width in pixels.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row.
    #[inline]
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// All pixels, mutable.
    #[inline]
    pub fn pixels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }

    /// One pixel.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> [f32; 3] {
        self.pixels[y * self.width + x]
    }

    /// Adds a picture of the same size where `alpha` lets it through: `self + (1 - alpha) picture`.
    pub fn add_behind(&mut self, alpha: &Mask, picture: &Self) {
        let behind = picture.pixels.iter().zip(alpha.values());
        for (pixel, (behind, alpha)) in self.pixels.iter_mut().zip(behind) {
            for (channel, behind) in pixel.iter_mut().zip(behind) {
                *channel += (1.0 - alpha) * behind;
            }
        }
    }

    /// `rgb * a + background * (1 - a)` with straight (un-premultiplied) colours, in sRGB values as 3DGS code does.
    ///
    /// # Errors
    /// If the sizes differ.
    pub fn composited(&self, alpha: &Mask, background: [f32; 3]) -> Result<Self, SceneError> {
        if (alpha.width, alpha.height) != (self.width, self.height) {
            return Err(SceneError::new(
                "mask",
                format!("{}x{}", alpha.width, alpha.height),
                format!("the image's {}x{}", self.width, self.height),
            ));
        }
        let blend =
            |(rgb, a): (&[f32; 3], &f32)| std::array::from_fn(|c| rgb[c] * a + background[c] * (1.0 - a));
        let pixels = self.pixels.iter().zip(&alpha.values).map(blend).collect();
        Ok(Self { width: self.width, height: self.height, pixels })
    }
}

impl Mask {
    /// A mask from its values.
    ///
    /// # Errors
    /// If the count is not `width * height`.
    pub fn new(width: usize, height: usize, values: Vec<f32>) -> Result<Self, SceneError> {
        check_count(width, height, values.len())?;
        Ok(Self { width, height, values })
    }

    /// A mask of one value.
    pub fn filled(width: usize, height: usize, value: f32) -> Self {
        Self { width, height, values: vec![value; width * height] }
    }

    /// Width in pixels.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// All values, row by row.
    #[inline]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All values, mutable.
    #[inline]
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// One value.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }
}

fn check_count(width: usize, height: usize, count: usize) -> Result<(), SceneError> {
    let expected = width.checked_mul(height);
    if expected == Some(count) && count > 0 {
        return Ok(());
    }
    Err(SceneError::new("pixels", format!("{count} of them"), format!("{width}x{height}, at least one")))
}
