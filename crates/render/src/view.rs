//! How a frame is looked at.

use skinsplat_core::scene::{Camera, Posed, SceneError, Underlay};

/// What Gaussians are seen through, over and together with.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Where from, and the size of the image.
    pub camera: &'a Camera,
    /// Linear order R, G, B; finite.
    pub background: [f32; 3],
    /// Compensates opacity for the low-pass on small splats (the original's `antialiasing` switch).
    pub antialiased: bool,
    /// A mesh's drawing among the Gaussians: in every pixel, Gaussians whose depth is less than the underlay's lie in
    /// front of it, then comes the underlay with its coverage for an alpha, then the other Gaussians, then the
    /// background. Alpha and depth include it.
    pub underlay: Option<Underlay<'a>>,
}

impl<'a> View<'a> {
    /// Through a camera, over black, without antialiasing: what 3DGS trains with.
    pub fn new(camera: &'a Camera) -> Self {
        Self { camera, background: [0.0; 3], antialiased: false, underlay: None }
    }

    /// The same view over another background.
    pub fn over(self, background: [f32; 3]) -> Self {
        Self { background, ..self }
    }

    /// The same view with or without antialiasing.
    pub fn antialiased(self, antialiased: bool) -> Self {
        Self { antialiased, ..self }
    }

    /// The same view with an underlay among the Gaussians, or without any.
    pub fn with_underlay(self, underlay: Option<Underlay<'a>>) -> Self {
        Self { underlay, ..self }
    }

    /// The same view through another camera.
    pub fn through(self, camera: &'a Camera) -> Self {
        Self { camera, ..self }
    }

    /// Width and height of the image, pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.camera.width as usize, self.camera.height as usize]
    }

    /// Checks what can be drawn: the camera, the length of every array of `posed`, the size of the underlay.
    ///
    /// # Errors
    /// Names the first field that is wrong.
    pub(crate) fn check(&self, posed: &Posed) -> Result<(), SceneError> {
        self.camera
            .validate()
            .map_err(|error| SceneError { field: format!("camera.{}", error.field), ..error })?;
        check_lengths(posed)?;
        let Some(Underlay { colour, coverage, depth }) = &self.underlay else { return Ok(()) };
        self.check_size("underlay.colour", [colour.width(), colour.height()])?;
        self.check_size("underlay.coverage", [coverage.width(), coverage.height()])?;
        self.check_size("underlay.depth", [depth.width(), depth.height()])
    }

    /// Whether an image has the camera's size.
    pub(crate) fn check_size(&self, field: &str, [width, height]: [usize; 2]) -> Result<(), SceneError> {
        let size = self.size();
        if size == [width, height] {
            return Ok(());
        }
        let expected = format!("the camera's {}x{}", size[0], size[1]);
        Err(SceneError::new(field, format!("{width}x{height} pixels"), expected))
    }
}

fn check_lengths(posed: &Posed) -> Result<(), SceneError> {
    if posed.sh_degree > skinsplat_core::math::sh::MAX_DEGREE {
        return Err(SceneError::new("sh_degree", posed.sh_degree.to_string(), "0 to 3"));
    }
    let n = posed.len();
    if u32::try_from(n).is_err() {
        return Err(SceneError::new("means", format!("{n} Gaussians"), "at most 4294967295"));
    }
    let lengths = [
        ("factors", posed.factors.len(), n),
        ("opacities", posed.opacities.len(), n),
        ("sh", posed.sh.len(), n * (posed.sh_degree + 1).pow(2)),
        ("view_frames", posed.view_frames.as_ref().map_or(n, |frames| frames.len()), n),
    ];
    match lengths.into_iter().find(|(_, found, expected)| found != expected) {
        Some((field, found, expected)) => {
            let expected = format!("{expected} for {n} Gaussians");
            Err(SceneError::new(field, format!("{found} values"), expected))
        }
        None => Ok(()),
    }
}
