//! Content digests: SHA-256 over what a sequence was read or generated from.

use super::sourced::SourceDigest;
use super::{Error, FrameSource, Sequence, Truth, error};
use glam::{DAffine3, DQuat, DVec3};
use sha2::{Digest, Sha256};
use skinsplat_core::scene::{Camera, LocalTransform, Pose, RestBody};

impl Sequence {
    /// SHA-256 in hexadecimal of the stored images and masks (or the generators' keys), of the stored numbers behind poses
    /// and cameras, and of the body: equal digests mean that an evaluation sees the same data. Angles count as they are
    /// stored, not the sines of them; the body is a polynomial of stored numbers. Names and paths do not count.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn digest(&self) -> Result<String, Error> {
        let mut hash = Fingerprint::new();
        self.body.add_to(&mut hash);
        hash.bytes(&self.poses.digest().0);
        hash.bytes(&self.cameras.digest().0);
        hash.count(self.frames.len());
        for frame in &self.frames {
            hash.count(frame.pose);
            hash.count(frame.camera);
            hash.source(&frame.source)?;
        }
        Ok(hash.finish().to_string())
    }
}

/// What has a digest of its own numbers.
pub trait Content {
    /// Adds every number to a hash.
    fn add_to(&self, hash: &mut Fingerprint);
}

/// A running hash. Lists are preceded by their length, so that no two contents give one stream of bytes.
pub struct Fingerprint(Sha256);

impl Fingerprint {
    pub(super) fn new() -> Self {
        Self(Sha256::new())
    }

    pub(super) fn finish(&mut self) -> SourceDigest {
        SourceDigest(self.0.finalize_reset().into())
    }

    pub(super) fn number(&mut self, n: u64) -> &mut Self {
        self.0.update(n.to_le_bytes());
        self
    }

    pub(super) fn count(&mut self, n: usize) -> &mut Self {
        self.number(n as u64)
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.count(bytes.len());
        self.0.update(bytes);
        self
    }

    pub(super) fn numbers(&mut self, values: impl IntoIterator<Item = f64>) {
        values.into_iter().for_each(|v| self.0.update(v.to_bits().to_le_bytes()));
    }

    fn singles(&mut self, values: &[f32]) {
        values.iter().for_each(|v| self.0.update(v.to_bits().to_le_bytes()));
    }

    pub(super) fn vectors(&mut self, vectors: &[DVec3]) {
        self.count(vectors.len());
        vectors.iter().for_each(|v| self.numbers(v.to_array()));
    }

    fn quaternion(&mut self, q: DQuat) {
        self.numbers(q.to_array());
    }

    fn affine(&mut self, m: &DAffine3) {
        self.numbers(m.to_cols_array());
    }

    pub(super) fn local(&mut self, local: &LocalTransform) {
        self.numbers(local.translation.to_array());
        self.quaternion(local.rotation);
        self.numbers(local.scale.to_array());
    }

    fn triples(&mut self, triples: &[[u32; 3]]) {
        self.count(triples.len());
        triples.as_flattened().iter().for_each(|i| self.0.update(i.to_le_bytes()));
    }

    fn source(&mut self, source: &FrameSource) -> Result<(), Error> {
        match source {
            FrameSource::Generated { generator, frame } => {
                self.bytes(generator.key()?.as_bytes());
                self.count(*frame);
            }
            FrameSource::Files(files) => {
                for path in files.paths() {
                    self.bytes(&error::read_bytes(path, "image", "a frame of the sequence")?);
                }
                if let Some(name) = files.mask.as_ref().and_then(|mask| mask.reading.name()) {
                    self.bytes(name.as_bytes());
                }
            }
        }
        Ok(())
    }
}

impl Content for RestBody {
    fn add_to(&self, hash: &mut Fingerprint) {
        hash.count(self.skeleton.len());
        for (parent, local) in self.skeleton.parents.iter().zip(&self.skeleton.rest_locals) {
            hash.count(parent.map_or(usize::MAX, |p| p));
            hash.local(local);
        }
        hash.count(self.skeleton.num_joints());
        self.skeleton.inverse_binds.iter().for_each(|m| hash.affine(m));
        hash.vectors(&self.vertices);
        for i in 0..self.weights.len() {
            let (joints, weights) = self.weights.row(i);
            hash.count(joints.len());
            for &joint in joints {
                hash.count(usize::from(joint));
            }
            hash.numbers(weights.iter().map(|&w| f64::from(w)));
        }
        hash.triples(&self.faces);
        hash.count(self.uv.as_ref().map_or(0, |uv| uv.coordinates.len()));
        if let Some(uv) = &self.uv {
            hash.numbers(uv.coordinates.iter().flatten().map(|&v| f64::from(v)));
            hash.triples(&uv.faces);
        }
        hash.count(self.pose_directions.len());
        hash.numbers(self.pose_directions.iter().flatten().flat_map(|v| v.as_dvec3().to_array()));
    }
}

impl Content for Vec<Pose> {
    fn add_to(&self, hash: &mut Fingerprint) {
        hash.count(self.len());
        for pose in self {
            hash.numbers(pose.translation.to_array());
            hash.count(pose.locals.len());
            pose.locals.iter().for_each(|local| hash.local(local));
            let blend = pose.blend_shape_rotations.as_deref().unwrap_or_default();
            hash.count(blend.len());
            blend.iter().for_each(|&q| hash.quaternion(q));
        }
    }
}

impl Content for Vec<Camera> {
    fn add_to(&self, hash: &mut Fingerprint) {
        hash.count(self.len());
        for camera in self {
            hash.numbers([f64::from(camera.width), f64::from(camera.height)]);
            hash.numbers([camera.fx, camera.fy, camera.cx, camera.cy]);
            hash.numbers(camera.camera_from_world.to_cols_array());
        }
    }
}

/// The digest of images in memory.
pub(super) fn of_truths(truths: &[Truth]) -> SourceDigest {
    let mut hash = Fingerprint::new();
    hash.count(truths.len());
    for truth in truths {
        hash.count(truth.rgb.width()).count(truth.rgb.height());
        hash.singles(truth.rgb.pixels().as_flattened());
        hash.count(truth.alpha.width()).count(truth.alpha.height());
        hash.singles(truth.alpha.values());
        truth.background.iter().for_each(|behind| hash.singles(behind.pixels().as_flattened()));
    }
    hash.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameGenerator, FrameRef, Sourced};
    use glam::DMat4;
    use skinsplat_core::scene::{Image, Mask, Skeleton, SkinWeights};
    use std::sync::Arc;

    #[derive(Debug)]
    struct Grey(f32);

    impl FrameGenerator for Grey {
        fn truth(&self, _: usize) -> Result<Truth, Error> {
            Ok(Truth::new(Image::filled(8, 4, [self.0; 3]), Mask::filled(8, 4, 1.0)))
        }

        fn key(&self) -> Result<String, Error> {
            Ok("grey".to_owned())
        }
    }

    fn sequence(grey: f32) -> Sequence {
        let camera = Camera {
            width: 8,
            height: 4,
            fx: 9.0,
            fy: 9.0,
            cx: 4.0,
            cy: 2.0,
            camera_from_world: DMat4::IDENTITY,
        };
        let skeleton = Skeleton::from_joint_positions(vec!["root".into()], vec![None], &[DVec3::ZERO]);
        let body = RestBody {
            skeleton: skeleton.unwrap(),
            vertices: vec![DVec3::X],
            faces: Vec::new(),
            weights: SkinWeights::from_rows([[(0, 1.0)]], 1).unwrap(),
            uv: None,
            pose_directions: Vec::new(),
        };
        let source = FrameSource::Generated { generator: Arc::new(Grey(grey)), frame: 0 };
        Sequence {
            id: "test".into(),
            poses: vec![Pose::rest(&body.skeleton)].into(),
            body: Arc::new(body),
            cameras: vec![camera].into(),
            frames: vec![FrameRef { name: "image".into(), time: 0, pose: 0, camera: 0, source }],
            stored_sizes: None,
        }
    }

    fn digest(sequence: &Sequence) -> String {
        sequence.digest().unwrap()
    }

    #[test]
    fn frames_in_memory_are_told_apart_by_their_pixels() {
        let held = |grey| sequence(grey).held().unwrap();
        assert_eq!(digest(&held(0.5)), digest(&held(0.5)));
        assert_ne!(digest(&held(0.5)), digest(&held(0.501)));
        assert_eq!(digest(&sequence(0.5)), digest(&sequence(0.501)), "a generator answers for its key");
    }

    #[test]
    fn computed_parts_count_as_what_they_were_computed_from() {
        let (plain, source) = (sequence(0.5), SourceDigest::of_bytes(b"angles"));
        let turned = |by: f64| {
            let mut poses = plain.poses.to_vec();
            poses[0].locals[0].rotation.x += by;
            poses
        };
        let with = |poses| digest(&Sequence { poses, ..plain.clone() });
        let computed = |by| with(Sourced::computed(turned(by), source));
        assert_eq!(computed(0.0), computed(1e-17 + 1e-9), "a sine was rounded otherwise");
        assert_ne!(computed(0.0), with(Sourced::computed(turned(0.0), SourceDigest::of_bytes(b"others"))));
        assert_ne!(with(turned(0.0).into()), with(turned(1e-9).into()), "numbers of their own count");
    }

    #[test]
    fn smaller_cameras_of_one_source_are_other_cameras() {
        let mut generated = sequence(0.5);
        generated.cameras = Sourced::computed(generated.cameras.to_vec(), SourceDigest::of_bytes(b"ring"));
        let sides = [8, 4, 2].map(|side| digest(&generated.reduced(side)));
        assert_eq!(sides[0], digest(&generated), "nothing was reduced");
        assert!(sides[0] != sides[1] && sides[1] != sides[2]);
    }
}
