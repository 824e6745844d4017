//! Avatars that jobs need: built from training frames once, kept in the run's folder, read back bit for bit.

use super::{Error, Library};
use crate::data::{Sequence, frames, npy, ply};
use crate::experiment::{AvatarBuild, AvatarRecipe};
use crate::fit::surface::{Placement, SurfaceInit, surface_init};
use crate::fit::texture::{TexturedBody, gather_texture};
use crate::render::mesh::Texture;
use crate::strategy::BoundAvatar;
use std::path::{Path, PathBuf};

/// An avatar that is ready to be posed.
#[derive(Debug)]
pub enum Prepared {
    /// Gaussians, bound to the subject's body.
    Gaussians(Box<BoundAvatar>),
    /// The body's mesh under a texture.
    Textured(TexturedBody),
}

/// Reads an avatar from the run's folder, or builds it and keeps it there. Whether it was kept makes no difference to a
/// single bit: a fresh avatar is read back too.
///
/// # Errors
/// Training frames that cannot be read or used, or a folder that cannot be written.
pub fn prepare(build: &AvatarBuild, library: &Library, folder: &Path) -> Result<Prepared, Error> {
    let sequence = training(build, library)?;
    let file = kept(build, folder);
    let fresh = !file.is_file();
    if let AvatarRecipe::TexturedMesh { size } = build.recipe {
        if fresh {
            npy_texture(&file, &gather_texture(&sequence, size)?)?;
        }
        let (image, _) = frames::load_image(&file)?;
        let uv = sequence
            .body
            .uv
            .clone()
            .ok_or_else(|| Error::Absent { name: format!("{}: uv", build.subject) })?;
        return Ok(Prepared::Textured(TexturedBody { uv, texture: Texture::new(image) }));
    }
    if fresh {
        let avatar = surface_init(&sequence, &surface_options(build))?;
        ply::write_avatar(&file, &avatar, &ply::Metadata::default(), ply::Encoding::LittleEndian)?;
    }
    let bound = BoundAvatar::new(&ply::read_avatar(&file)?, &sequence.body)?;
    Ok(Prepared::Gaussians(Box::new(bound)))
}

/// The frames that an avatar is made from.
fn training(build: &AvatarBuild, library: &Library) -> Result<Sequence, Error> {
    let Some(id) = &build.sequence else {
        return Err(Error::Absent {
            name: format!("{}/{}: training sequence", build.dataset, build.subject),
        });
    };
    let sequence = library.sequence(&build.dataset, &build.subject, id)?.selected(&build.frames)?;
    Ok(match build.resolution {
        Some(side) => sequence.reduced(side),
        None => sequence,
    })
}

fn kept(build: &AvatarBuild, folder: &Path) -> PathBuf {
    let extension = if build.recipe.is_gaussian() { "ply" } else { "npy" };
    folder.join(format!("{}.{extension}", build.key))
}

fn npy_texture(file: &Path, textured: &TexturedBody) -> Result<(), Error> {
    let image = textured.texture.image();
    let values = image.pixels().as_flattened().iter().copied();
    Ok(npy::write_f32(file, &[image.height(), image.width(), 3], values)?)
}

fn surface_options(build: &AvatarBuild) -> SurfaceInit {
    let placement = match build.recipe {
        AvatarRecipe::SurfaceFace { .. } => Placement::Faces,
        _ => Placement::Vertices,
    };
    let default = SurfaceInit::default();
    SurfaceInit { placement, sh_degree: build.sh_degree.map_or(default.sh_degree, usize::from), ..default }
}
