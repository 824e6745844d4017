//! One frame, loaded: its truth, its camera, the body in its pose. Here drawing and scoring meet.

use super::Error;
use super::drawable::{Behind, Drawable, Drawn, Look, PosedView, Scratch};
use skinsplat_core::scene::{Pose, PosedBody};
use skinsplat_data::{FrameSource, Sequence, Truth};
use skinsplat_metrics::{AvatarStats, FrameScore, Protocol, Wanted};
use skinsplat_posing::face_spreads;
use skinsplat_render::mesh::{Mesh, visible_faces};
use std::sync::OnceLock;
use std::time::Instant;

/// A frame, loaded.
pub(super) struct Frame<'a> {
    pub(super) truth: Truth,
    pub(super) view: PosedView<'a>,
    /// Its sequence, and which of its frames it is.
    pub(super) place: (&'a Sequence, usize),
    /// [`Wanted::bend`], once somebody asks.
    bend: OnceLock<Vec<f32>>,
    /// [`Frame::before`], once somebody asks.
    before: OnceLock<Result<Box<Frame<'a>>, String>>,
}

/// What came of a drawing and its comparison with the truth.
pub(super) struct Scored {
    pub(super) score: FrameScore,
    pub(super) drawn: Drawn,
    pub(super) score_seconds: f64,
}

impl<'a> Frame<'a> {
    /// Loads a frame. If `joints_read` says which joints' rotations will be read, the others are left out.
    ///
    /// # Errors
    /// A truth that cannot be read, a pose that does not fit the body.
    pub(super) fn load(
        sequence: &'a Sequence,
        index: usize,
        joints_read: Option<&[bool]>,
    ) -> Result<Self, Error> {
        let truth = sequence.truth(index)?;
        let frame = &sequence.frames[index];
        let (pose, camera) = (&sequence.poses[frame.pose], &sequence.cameras[frame.camera]);
        let body = match joints_read {
            Some(read) => PosedBody::with_rotations(&sequence.body, pose, |joint| read[joint])?,
            None => PosedBody::new(&sequence.body, pose)?,
        };
        let (name, stored) = (frame.name.as_str(), sequence.stored_size(frame.camera));
        let view = PosedView { pose, camera, body, name, stored };
        let (bend, before) = (OnceLock::new(), OnceLock::new());
        Ok(Self { truth, view, place: (sequence, index), bend, before })
    }

    /// The frame before it in the data's sequence ([`Sequence::before`]), whether it is scored or not, or why there is none.
    pub(super) fn before(&self) -> Result<&Self, &str> {
        let load = || {
            let (sequence, index) = self.place;
            let before = sequence.before(index).ok_or("none by this camera")?;
            Self::load(sequence, before, None).map(Box::new).map_err(|error| error.to_string())
        };
        self.before.get_or_init(load).as_deref().map_err(String::as_str)
    }

    /// The truth as metrics see it.
    pub(super) fn straight_truth(&self) -> skinsplat_metrics::Truth<'_> {
        skinsplat_metrics::Truth::Straight { rgb: &self.truth.rgb, alpha: &self.truth.alpha }
    }

    /// The view of the frame in another pose.
    ///
    /// # Errors
    /// A pose of another body.
    pub(super) fn in_pose<'p>(&'p self, pose: &'p Pose) -> Result<PosedView<'p>, Error> {
        let PosedView { camera, ref body, name, stored, .. } = self.view;
        Ok(PosedView { pose, camera, body: PosedBody::new(body.rest, pose)?, name, stored })
    }

    /// Draws the frame and scores the drawing.
    ///
    /// # Errors
    /// As [`Drawable::draw`]; an image that cannot be scored.
    pub(super) fn evaluate(
        &self,
        drawable: &Drawable<'_>,
        look: &Look<'_>,
        protocol: &Protocol,
        wanted: Wanted<'_>,
        scratch: &mut Scratch,
    ) -> Result<Scored, Error> {
        self.evaluate_view(&self.view, drawable, look, protocol, wanted, scratch)
    }

    /// The same for a view of [`Frame::in_pose`].
    ///
    /// # Errors
    /// As [`Frame::evaluate`].
    pub(super) fn evaluate_view(
        &self,
        view: &PosedView<'_>,
        drawable: &Drawable<'_>,
        look: &Look<'_>,
        protocol: &Protocol,
        wanted: Wanted<'_>,
        scratch: &mut Scratch,
    ) -> Result<Scored, Error> {
        let drawn = drawable.draw(view, look, scratch)?;
        let bend = match wanted.metrics.iter().any(|metric| metric.needs_bend()) {
            true => Some(self.bend()?),
            false => None,
        };
        let start = Instant::now();
        let alpha = &self.truth.alpha;
        #[cfg(feature = "faults")]
        let faulty = super::faults::of_scoring(protocol, alpha);
        #[cfg(feature = "faults")]
        let (protocol, alpha) = (&*faulty.0, &*faulty.1);
        let truth = skinsplat_metrics::Truth::Straight { rgb: &self.truth.rgb, alpha };
        let wanted = Wanted { avatar: AvatarStats { gaussians: drawn.splats }, bend, ..wanted };
        let score = protocol.score_with(&drawn.image, truth, wanted)?;
        Ok(Scored { score, drawn, score_seconds: start.elapsed().as_secs_f64() })
    }

    /// By how much the body is bent where each pixel shows it, degrees; -1 where there is no body. It is the same for every
    /// avatar and strategy, so that they are compared on the same pixels. The frame must know all joints' rotations.
    fn bend(&self) -> Result<&[f32], Error> {
        if let Some(bend) = self.bend.get() {
            return Ok(bend);
        }
        let body = &self.view.body;
        let spreads = face_spreads(body);
        let mesh = Mesh::new(&body.mesh().vertices, &body.rest.faces)?;
        let seen = visible_faces(&mesh, self.view.camera)?;
        let at = |i: usize| seen.face(i % seen.width(), i / seen.width());
        let pixels = 0..seen.width() * seen.height();
        let bend = pixels.map(|i| at(i).map_or(-1.0, |face| spreads[face as usize])).collect();
        Ok(self.bend.get_or_init(|| bend))
    }
}

/// What a protocol puts behind the subject, for a truth.
///
/// # Errors
/// A captured background, for a truth that has none.
pub(super) fn behind<'a>(protocol: &Protocol, truth: &'a Truth) -> Result<Behind<'a>, Error> {
    let captured = || truth.background.as_ref().map(Behind::Picture);
    let behind = protocol.background_colour().map(Behind::Colour).or_else(captured);
    behind.ok_or_else(|| no_background(protocol))
}

/// Checks what is known before a truth is loaded: a captured background needs a file.
///
/// # Errors
/// As [`behind`].
pub(super) fn check_background(protocol: &Protocol, source: &FrameSource) -> Result<(), Error> {
    match source {
        FrameSource::Files(files) if protocol.background_colour().is_none() && files.background.is_none() => {
            Err(no_background(protocol))
        }
        _ => Ok(()),
    }
}

fn no_background(protocol: &Protocol) -> Error {
    Error::NoBackground { protocol: protocol.id.clone() }
}
