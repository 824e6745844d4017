//! Content digests: SHA-256 over the bits of everything that a sequence holds.

use super::{Error, FrameSource, Sequence, error};
use glam::{DAffine3, DQuat, DVec3};
use sha2::{Digest, Sha256};
use skinsplat_core::scene::{Camera, Pose, RestBody};

impl Sequence {
    /// SHA-256 of the stored images and masks (or the generators' keys), cameras, poses and body, in hexadecimal: equal
    /// digests mean that an evaluation sees the same data. Names and paths do not count.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn digest(&self) -> Result<String, Error> {
        let mut hash = Fingerprint(Sha256::new());
        hash.body(&self.body);
        hash.count(self.poses.len());
        self.poses.iter().for_each(|pose| hash.pose(pose));
        hash.count(self.cameras.len());
        self.cameras.iter().for_each(|camera| hash.camera(camera));
        hash.count(self.frames.len());
        for frame in &self.frames {
            hash.count(frame.pose);
            hash.count(frame.camera);
            hash.source(&frame.source)?;
        }
        Ok(hash.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    }
}

/// A running hash. Lists are preceded by their length, so that no two contents give one stream of bytes.
struct Fingerprint(Sha256);

impl Fingerprint {
    fn count(&mut self, n: usize) {
        self.0.update((n as u64).to_le_bytes());
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.0.update(bytes);
    }

    fn numbers(&mut self, values: impl IntoIterator<Item = f64>) {
        values.into_iter().for_each(|v| self.0.update(v.to_bits().to_le_bytes()));
    }

    fn vector(&mut self, v: DVec3) {
        self.numbers(v.to_array());
    }

    fn quaternion(&mut self, q: DQuat) {
        self.numbers(q.to_array());
    }

    fn affine(&mut self, m: &DAffine3) {
        self.numbers(m.to_cols_array());
    }

    fn body(&mut self, body: &RestBody) {
        self.count(body.skeleton.len());
        for (parent, local) in body.skeleton.parents.iter().zip(&body.skeleton.rest_locals) {
            self.count(parent.map_or(usize::MAX, |p| p));
            self.vector(local.translation);
            self.quaternion(local.rotation);
            self.vector(local.scale);
        }
        self.count(body.skeleton.num_joints());
        body.skeleton.inverse_binds.iter().for_each(|m| self.affine(m));
        self.count(body.vertices.len());
        body.vertices.iter().for_each(|&v| self.vector(v));
        for i in 0..body.weights.len() {
            let (joints, weights) = body.weights.row(i);
            self.count(joints.len());
            joints.iter().for_each(|&j| self.count(usize::from(j)));
            self.numbers(weights.iter().map(|&w| f64::from(w)));
        }
        self.triples(&body.faces);
        self.count(body.uv.as_ref().map_or(0, |uv| uv.coordinates.len()));
        if let Some(uv) = &body.uv {
            self.numbers(uv.coordinates.iter().flatten().map(|&v| f64::from(v)));
            self.triples(&uv.faces);
        }
        self.count(body.pose_directions.len());
        self.numbers(body.pose_directions.iter().flatten().flat_map(|v| v.as_dvec3().to_array()));
    }

    fn triples(&mut self, triples: &[[u32; 3]]) {
        self.count(triples.len());
        triples.as_flattened().iter().for_each(|i| self.0.update(i.to_le_bytes()));
    }

    fn pose(&mut self, pose: &Pose) {
        self.vector(pose.translation);
        self.count(pose.locals.len());
        for local in &pose.locals {
            self.vector(local.translation);
            self.quaternion(local.rotation);
            self.vector(local.scale);
        }
        let blend = pose.blend_shape_rotations.as_deref().unwrap_or_default();
        self.count(blend.len());
        blend.iter().for_each(|&q| self.quaternion(q));
    }

    fn camera(&mut self, camera: &Camera) {
        self.numbers([f64::from(camera.width), f64::from(camera.height)]);
        self.numbers([camera.fx, camera.fy, camera.cx, camera.cy]);
        self.numbers(camera.camera_from_world.to_cols_array());
    }

    fn source(&mut self, source: &FrameSource) -> Result<(), Error> {
        match source {
            FrameSource::Generated { generator, frame } => {
                self.bytes(generator.key().as_bytes());
                self.count(*frame);
            }
            FrameSource::Files { image, mask } => {
                self.bytes(&error::read_bytes(image, "image", "a frame of the sequence")?);
                if let Some(mask) = mask {
                    self.bytes(&error::read_bytes(mask, "mask", "a frame of the sequence")?);
                }
            }
        }
        Ok(())
    }
}
