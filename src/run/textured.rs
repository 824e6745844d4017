//! Textured bodies as files: the texture as an image, the vertices beside it.

use super::Error;
use glam::DVec3;
use skinsplat_core::scene::{Image, RestBody};
use skinsplat_data::avatar::mesh_beside;
use skinsplat_data::{frames, npy};
use skinsplat_fit::texture::TexturedBody;
use skinsplat_render::mesh::Texture;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Where the parts of a textured body are kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TexturedFiles {
    /// The texture: `.png` rounds colours to 8 bits, `.npy` keeps them.
    pub texture: PathBuf,
    /// The vertices in the rest pose, metres (`.npy`, `f32`, one row each).
    pub vertices: PathBuf,
}

impl TexturedFiles {
    /// The mesh of a hybrid, beside the PLY of its Gaussians.
    pub fn beside(avatar: &Path) -> Self {
        let [texture, vertices] = mesh_beside(avatar);
        Self { texture, vertices }
    }

    /// True if all of them are there.
    pub fn exist(&self) -> bool {
        self.texture.is_file() && self.vertices.is_file()
    }

    /// Writes a textured body.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, textured: &TexturedBody) -> Result<(), Error> {
        let vertices = &textured.body.vertices;
        let values = vertices.iter().flat_map(|v| v.as_vec3().to_array());
        npy::write_f32(&self.vertices, &[vertices.len(), 3], values)?;
        let texels = textured.texture.image();
        match is_png(&self.texture) {
            true => frames::save_png(&self.texture, texels)?,
            false => frames::save_npy(&self.texture, texels)?,
        }
        Ok(())
    }

    /// Reads a textured body: `bare` with other vertices, under the texture.
    ///
    /// # Errors
    /// A file that cannot be read or does not fit the body; a body without texture coordinates.
    pub fn read(&self, bare: &RestBody) -> Result<TexturedBody, Error> {
        let (image, _) = frames::load_image(&self.texture)?;
        let vertices: Vec<DVec3> =
            npy::read(&self.vertices)?.values.chunks_exact(3).map(DVec3::from_slice).collect();
        let body = RestBody { vertices, ..bare.clone() };
        body.validate()?;
        let no_uv = || Error::Absent { name: "texture coordinates of the body".to_owned() };
        let uv = bare.uv.clone().ok_or_else(no_uv)?;
        Ok(TexturedBody { body: Arc::new(body), uv, texture: Texture::new(image) })
    }
}

/// A body under a texture that belongs to an avatar's file.
///
/// # Errors
/// A body without texture coordinates.
pub(super) fn covered(image: Image, body: &RestBody, path: &Path) -> Result<TexturedBody, Error> {
    let Some(uv) = body.uv.clone() else {
        let expected =
            "texture coordinates (vt and ft) in the body model, to draw the mesh under the Gaussians";
        return Err(skinsplat_data::Error::invalid(
            path,
            "texture",
            "the body has no place for it",
            expected,
        )
        .into());
    };
    Ok(TexturedBody { body: Arc::new(body.clone()), uv, texture: Texture::new(image) })
}

fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "png")
}
