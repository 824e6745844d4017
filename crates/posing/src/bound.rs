//! An avatar bound to a body: everything that does not depend on the pose, computed once.

use super::error::expect_count;
use super::groups::{self, Group};
use super::layout::{self, CHUNK, Chunk};
use super::nearest::NearestFace;
use super::push_forward::{self, Tangents};
use super::surface::{self, Embedding, Surface};
use super::{CovarianceChoice, PosingError, Strategy, surfel};
use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, PosedBody, RestBody, SceneError, SkinWeights};
use std::sync::OnceLock;

/// A canonical avatar and how it hangs on a body.
///
/// * Gaussians with weights of their own also know the point of the rest mesh nearest to their mean (the lowest face
///   index where several are equally near): face strategies rotate them with that face.
/// * Face-bound Gaussians also have skinning weights, the barycentric mix of the rows of the corners (coordinates below
///   zero count as zero). Their canonical mean is not read: they sit where the binding says.
/// * Static Gaussians stay as they are under every strategy.
#[derive(Clone, Debug)]
pub struct BoundAvatar {
    chunks: Vec<Chunk>,
    discs: OnceLock<Vec<Chunk>>,
    groups: OnceLock<Vec<Group>>,
    tangents: OnceLock<Vec<Tangents>>,
    pub(crate) means: Vec<Vec3>,
    pub(crate) surface: Option<Surface>,
    pub(crate) moves: Moves,
    pub(crate) opacities: Vec<f32>,
    pub(crate) sh_degree: usize,
    pub(crate) sh: Vec<[f32; 3]>,
    pub(crate) shape: BodyShape,
}

/// How means move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moves {
    /// Not at all.
    Not,
    /// By Eq. 6.
    ByWeights,
    /// With the posed mesh.
    WithFaces,
}

/// The counts of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BodyShape {
    joints: usize,
    vertices: usize,
    faces: usize,
}

impl BodyShape {
    pub(crate) fn of(body: &RestBody) -> Self {
        Self { joints: body.skeleton.num_joints(), vertices: body.vertices.len(), faces: body.faces.len() }
    }
}

impl Moves {
    fn of(binding: &Binding) -> Self {
        match binding {
            Binding::Static => Self::Not,
            Binding::Vertex(_) => Self::ByWeights,
            Binding::Face(_) => Self::WithFaces,
        }
    }
}

impl std::fmt::Display for Moves {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Not => "a static avatar",
            Self::ByWeights => "skinning weights per Gaussian",
            Self::WithFaces => "a face per Gaussian",
        })
    }
}

impl std::fmt::Display for BodyShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} joints, {} vertices, {} faces", self.joints, self.vertices, self.faces)
    }
}

impl BoundAvatar {
    /// Binds an avatar to a body in its rest pose.
    ///
    /// # Errors
    /// [`PosingError::Scene`] for whatever [`Avatar::validate`] or [`RestBody::validate`] finds wrong.
    pub fn new(avatar: &Avatar, body: &RestBody) -> Result<Self, PosingError> {
        body.validate()?;
        let faces = match &avatar.binding {
            Binding::Vertex(_) => NearestFace::new(body),
            Binding::Static | Binding::Face(_) => None,
        };
        Self::bind(avatar, body, faces.as_ref(), None)
    }

    /// Binds an avatar anew to the same body, of which the caller keeps the `faces` (those of `body`; none if it has none).
    /// Where the Gaussians are those that were bound before, each begins the search for its face at the one it had: the
    /// result has the bits of [`BoundAvatar::new`].
    ///
    /// # Errors
    /// As [`BoundAvatar::new`]. Nothing has changed then.
    pub fn rebind(
        &mut self,
        avatar: &Avatar,
        body: &RestBody,
        faces: Option<&NearestFace<'_>>,
    ) -> Result<(), PosingError> {
        let before = self.surface.as_ref().map(|surface| &surface.embeddings[..]);
        let same = |embeddings: &&[Embedding]| embeddings.len() == avatar.gaussians.len();
        *self = Self::bind(avatar, body, faces, before.filter(same))?;
        Ok(())
    }

    fn bind(
        avatar: &Avatar,
        body: &RestBody,
        faces: Option<&NearestFace<'_>>,
        before: Option<&[Embedding]>,
    ) -> Result<Self, PosingError> {
        avatar.validate(Some(body))?;
        let gaussians = &avatar.gaussians;
        let (embeddings, mixed, moves) = match &avatar.binding {
            Binding::Static => (None, None, Moves::Not),
            Binding::Vertex(_) => {
                let embeddings = faces.map(|faces| surface::nearest(&gaussians.means, body, faces, before));
                (embeddings, None, Moves::ByWeights)
            }
            Binding::Face(binding) => {
                let embeddings = surface::given(binding, body);
                let mixed = mixed_weights(&embeddings, body)?;
                (Some(embeddings), Some(mixed), Moves::WithFaces)
            }
        };
        let weights = match &avatar.binding {
            Binding::Vertex(weights) => Some(weights),
            Binding::Static | Binding::Face(_) => mixed.as_ref(),
        };
        let n = gaussians.len();
        let mut bound = Self {
            chunks: layout::chunks(n, weights),
            discs: OnceLock::new(),
            groups: OnceLock::new(),
            tangents: OnceLock::new(),
            means: vec![Vec3::ZERO; n],
            surface: embeddings.map(|embeddings| Surface::new(embeddings, body)),
            moves,
            opacities: vec![0.0; n],
            sh_degree: 0,
            sh: Vec::new(),
            shape: BodyShape::of(body),
        };
        bound.refresh(gaussians);
        Ok(bound)
    }

    /// Takes over what an optimiser changed in the avatar: means, rotations, scales, opacities, SH (of any degree), and
    /// the barycentric coordinates and offsets of face-bound Gaussians. In place, in parallel, without laying anything
    /// out anew.
    ///
    /// What [`BoundAvatar::new`] derived from the binding stays as it was then: skinning weights (those of the avatar are
    /// not read again, those of face-bound Gaussians stay mixed with the coordinates of that time) and the nearest face
    /// of each Gaussian with weights of its own, with its nearest point. Where these are the same, the result poses to
    /// the same bits as a freshly bound avatar. Values are not checked: an optimiser that makes NaNs must look for them.
    ///
    /// # Errors
    /// [`PosingError::Scene`] if the kind of binding, a count or the face of a Gaussian is not that of the avatar that
    /// was bound, which must then be bound anew. Nothing has changed then.
    pub fn update(&mut self, avatar: &Avatar) -> Result<(), PosingError> {
        let moves = Moves::of(&avatar.binding);
        if moves != self.moves {
            let (found, expected) = (moves.to_string(), format!("{} as at binding", self.moves));
            return Err(SceneError::new("binding", found, expected).into());
        }
        self.check_counts(&avatar.gaussians)?;
        if let (Binding::Face(binding), Some(surface)) = (&avatar.binding, &mut self.surface) {
            surface.update(binding)?;
        }
        self.refresh(&avatar.gaussians);
        Ok(())
    }

    /// The body has the counts of the one that the avatar was bound to.
    pub(crate) fn check_body(&self, body: &PosedBody<'_>) -> Result<(), PosingError> {
        let shape = BodyShape::of(body.rest);
        if shape == self.shape {
            return Ok(());
        }
        Err(PosingError::OtherBody { found: shape.to_string(), expected: self.shape.to_string() })
    }

    /// All arrays have an entry for each of the bound Gaussians.
    pub(crate) fn check_counts(&self, gaussians: &Gaussians) -> Result<(), SceneError> {
        if gaussians.sh_degree > sh::MAX_DEGREE {
            return Err(SceneError::new("f_rest", format!("degree {}", gaussians.sh_degree), "0 to 3"));
        }
        let n = self.len();
        expect_count("x, y, z", gaussians.means.len(), n)?;
        expect_count("rot", gaussians.rotations.len(), n)?;
        expect_count("scale", gaussians.log_scales.len(), n)?;
        expect_count("opacity", gaussians.opacity_logits.len(), n)?;
        expect_count("f_dc/f_rest", gaussians.sh.len(), n * gaussians.sh_count())
    }

    /// Reads the parameters of all Gaussians; counts must fit.
    fn refresh(&mut self, gaussians: &Gaussians) {
        let rest = self.surface.as_ref().filter(|_| self.moves == Moves::WithFaces);
        let places = self.means.par_chunks_mut(CHUNK).zip(self.opacities.par_chunks_mut(CHUNK));
        let chunks = self.chunks.par_iter_mut().zip(places).enumerate();
        chunks.for_each(|(c, (chunk, (means, opacities)))| {
            let start = c * CHUNK;
            match rest {
                Some(surface) => surface.rest_means(start, means),
                None => means.copy_from_slice(&gaussians.means[start..start + means.len()]),
            }
            for (i, opacity) in opacities.iter_mut().enumerate() {
                *opacity = gaussians.opacity(start + i);
            }
            chunk.fill(means, gaussians, start);
        });
        self.sh_degree = gaussians.sh_degree;
        self.sh.resize(gaussians.sh.len(), [0.0; 3]);
        let coefficients = self.sh.par_chunks_mut(CHUNK).zip(gaussians.sh.par_chunks(CHUNK));
        coefficients.for_each(|(own, given)| own.copy_from_slice(given));
        if let (Some(discs), Some(surface)) = (self.discs.get_mut(), &self.surface) {
            surfel::refresh(discs, &self.chunks, surface);
        }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// The Gaussians as a covariance choice reads them. Discs are made when first asked for.
    pub(crate) fn chunks(&self, choice: CovarianceChoice) -> &[Chunk] {
        match (choice, &self.surface) {
            (CovarianceChoice::Surfel, Some(surface)) => {
                self.discs.get_or_init(|| surfel::discs(&self.chunks, surface))
            }
            _ => &self.chunks,
        }
    }

    /// How weights change along the surface, by chunk; `None` for avatars that know no faces. Gathered when first asked for,
    /// from the body that the avatar was bound to.
    pub(crate) fn tangents(&self, body: &RestBody) -> Option<&[Tangents]> {
        let surface = self.surface.as_ref()?;
        let on_faces = self.moves == Moves::WithFaces;
        let gather = || push_forward::tangents(&self.chunks, surface, on_faces, body);
        Some(self.tangents.get_or_init(gather).as_slice())
    }

    /// The Gaussians by their joints. Gathered when first asked for; weights do not change after binding.
    pub(crate) fn groups(&self) -> &[Group] {
        self.groups.get_or_init(|| groups::groups(&self.chunks))
    }

    /// For each joint whether a strategy reads its rotation: for [`PosedBody::with_rotations`]. Strategies that read the
    /// mesh read all.
    pub fn joints_read(&self, strategy: &Strategy) -> Vec<bool> {
        let mut read = vec![strategy.rotation.needs_faces(); self.shape.joints];
        for &joint in self.groups().iter().flat_map(Group::joints) {
            read[usize::from(joint)] = true;
        }
        read
    }

    /// The Gaussians as they were bound.
    pub(crate) fn all_chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// The highest SH degree of which some Gaussian has a coefficient other than 0.
    pub fn sh_degree_present(&self) -> usize {
        let count = self.sh_count();
        let bands =
            |own: &[[f32; 3]]| own.iter().rposition(|c| *c != [0.0; 3]).map_or(0, |last| last.isqrt());
        self.sh.par_chunks_exact(count).map(bands).max().unwrap_or(0)
    }

    /// Drops the SH bands above [`Self::sh_degree_present`]: nothing that is drawn changes, and nothing is rotated or
    /// evaluated that is 0. Not for fitting, where a band may be about to leave 0; [`Self::update`] brings them back.
    #[must_use]
    pub fn without_zero_bands(mut self) -> Self {
        let (stored, present) = (self.sh_count(), self.sh_degree_present());
        if present < self.sh_degree {
            let kept = sh::count(present);
            self.sh =
                self.sh.par_chunks_exact(stored).flat_map_iter(|own| own[..kept].iter().copied()).collect();
            self.sh_degree = present;
        }
        self
    }

    /// SH coefficients per Gaussian and channel.
    pub(crate) fn sh_count(&self) -> usize {
        (self.sh_degree + 1).pow(2)
    }

    /// The face and the barycentric coordinates of Gaussian `i`; `None` for static avatars and bodies without faces.
    pub fn face(&self, i: usize) -> Option<(u32, [f32; 3])> {
        let embedding = self.surface.as_ref()?.embeddings.get(i)?;
        Some((embedding.face, embedding.barycentric))
    }
}

/// The skinning weights of the body in the points in which Gaussians are embedded.
fn mixed_weights(embeddings: &[Embedding], body: &RestBody) -> Result<SkinWeights, PosingError> {
    let row = |own: &Embedding| body.weights_at(own.face, own.weights().map(f64::from));
    let rows: Vec<_> = embeddings.par_iter().map(row).collect();
    Ok(SkinWeights::from_rows(rows, body.skeleton.num_joints())?)
}
