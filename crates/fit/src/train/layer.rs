//! The textured mesh of a hybrid while it is fitted: drawn with the Gaussians, its texels fitted with them.

use crate::Error;
use crate::adam::Adam;
use crate::recipe::{MeshLayer, Recipe};
use crate::texture::{SAMPLES, TextureInit, TexturedBody, gather_texture};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::{Camera, Image, Mask, Pose, RestBody, SceneError};
use skinsplat_data::sequence::Sequence;
use skinsplat_render::mesh::{Drawing, SamplePattern, Texture};
use std::sync::Arc;

/// A textured mesh that is being fitted.
pub(super) struct Layer {
    pub(super) textured: TexturedBody,
    moments: Adam,
    rate: f32,
    gradient: Image,
}

/// All of a [`Layer`] that a fit changes, and the vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    vertices: Vec<Vec3>,
    texels: Vec<[f32; 3]>,
    moments: Adam,
}

impl Layer {
    /// Gathers the texture with which a fit starts. Vertices are rounded to `f32`, in which they are kept.
    pub(super) fn new(sequence: &Sequence, recipe: &Recipe, mesh: &MeshLayer) -> Result<Self, Error> {
        let init = TextureInit {
            size: mesh.texture,
            prior_weight: mesh.prior_weight,
            gutter: mesh.gutter,
            clothing: recipe.clothing.clone(),
            sighting: recipe.sighting.clone(),
            cover: recipe.cover.clone(),
        };
        let mut textured = gather_texture(sequence, &init)?;
        let vertices = textured.body.vertices.iter().map(|v| v.as_vec3().as_dvec3()).collect();
        textured.body = Arc::new(RestBody { vertices, ..(*textured.body).clone() });
        let texels = textured.texture.image().pixels().as_flattened().len();
        Ok(Self::with(textured, Adam::new(texels, mesh.moments), mesh))
    }

    /// Goes on from a checkpoint.
    pub(super) fn resume(sequence: &Sequence, recipe: &MeshLayer, state: State) -> Result<Self, Error> {
        let State { vertices, texels, moments } = state;
        let refuse = |error: SceneError| Error::Checkpoint { problem: error.to_string() };
        if !moments.is_for(3 * texels.len()) {
            return Err(Error::Checkpoint { problem: "it has not one moment per texel".to_owned() });
        }
        let side = recipe.texture as usize;
        let texture = Texture::new(Image::new(side, side, texels).map_err(refuse)?);
        let vertices: Vec<DVec3> = vertices.into_iter().map(Vec3::as_dvec3).collect();
        let body = RestBody { vertices, ..(*sequence.body).clone() };
        body.validate().map_err(refuse)?;
        let none = || SceneError::new("body", "no texture coordinates", "uv per face corner");
        let uv = body.uv.clone().ok_or_else(none).map_err(refuse)?;
        Ok(Self::with(TexturedBody { body: Arc::new(body), uv, texture }, moments, recipe))
    }

    fn with(textured: TexturedBody, moments: Adam, recipe: &MeshLayer) -> Self {
        let texels = textured.texture.image();
        let gradient = Image::filled(texels.width(), texels.height(), [0.0; 3]);
        Self { textured, moments, rate: recipe.rate, gradient }
    }

    pub(super) fn state(&self) -> State {
        State {
            vertices: self.textured.body.vertices.iter().map(|v| v.as_vec3()).collect(),
            texels: self.textured.texture.image().pixels().to_vec(),
            moments: self.moments.clone(),
        }
    }

    pub(super) fn draw(&self, pose: &Pose, camera: &Camera) -> Result<Drawing, SceneError> {
        self.textured.drawing(pose, camera, SamplePattern::new(SAMPLES))
    }

    /// One step of the texels, against derivatives of the image of the frame drawn last, in which the drawing's colours
    /// are `shown` with these weights.
    pub(super) fn step(
        &mut self,
        pose: &Pose,
        camera: &Camera,
        of_image: &Image,
        shown: &Mask,
    ) -> Result<(), SceneError> {
        if self.rate == 0.0 {
            return Ok(());
        }
        let weighted = |(colour, &shown): (&[f32; 3], &f32)| colour.map(|c| c * shown);
        let pixels = of_image.pixels().iter().zip(shown.values()).map(weighted).collect();
        let upstream = Image::new(of_image.width(), of_image.height(), pixels)?;
        let pattern = SamplePattern::new(SAMPLES);
        self.textured.backward(pose, camera, pattern, &upstream, &mut self.gradient)?;
        let texels = self.textured.texture.image_mut().pixels_mut().as_flattened_mut();
        self.moments.step(texels, self.gradient.pixels().as_flattened(), self.rate);
        Ok(())
    }
}
