//! Avatars whoever made them: which format is this?
//!
//! [`read_avatar`] tells formats apart by what is there, not by what a file is called. A further format is a further arm in
//! it.

use super::{Error, error, ply, splatting_avatar};
use glam::DVec3;
use sha2::{Digest, Sha256};
use skinsplat_core::scene::{Avatar, Binding};
use std::path::{Path, PathBuf};

/// How an avatar is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A 3DGS PLY, with or without a binding ([`ply`]).
    Ply,
    /// An export of SplattingAvatar ([`splatting_avatar`]).
    SplattingAvatar,
}

impl Format {
    /// Its name in prose.
    pub fn title(self) -> &'static str {
        match self {
            Self::Ply => "3DGS PLY",
            Self::SplattingAvatar => "SplattingAvatar export",
        }
    }
}

/// A mesh in the order of a body model's vertices and faces.
#[derive(Clone, Debug, PartialEq)]
pub struct CanonicalMesh {
    /// Vertices, metres.
    pub vertices: Vec<DVec3>,
    /// Triangles.
    pub faces: Vec<[u32; 3]>,
}

/// An avatar as its files have it.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedAvatar {
    /// How it is stored.
    pub format: Format,
    /// The Gaussians and their binding: [`Binding::Static`] if the files name none.
    pub avatar: Avatar,
    /// The mesh on which rotations are canonical, where that is not the body in its rest pose.
    pub canonical: Option<CanonicalMesh>,
    /// The body model that it was bound to, as the writer named it.
    pub body: Option<String>,
    /// Comments of the writer.
    pub comments: Vec<String>,
    /// Every file that belongs to it, the Gaussians' first.
    pub files: Vec<PathBuf>,
    /// What whoever uses it has to know, a clause each.
    pub notes: Vec<String>,
}

/// Reads an avatar: a 3DGS PLY, or an export of SplattingAvatar (`point_cloud.ply` with `embedding.json` beside it, or
/// the folder that holds both).
///
/// # Errors
/// As [`ply::read`] and [`splatting_avatar::load`]; a folder without an avatar.
pub fn read_avatar(path: &Path) -> Result<LoadedAvatar, Error> {
    let gaussians = if path.is_dir() { path.join(splatting_avatar::GAUSSIANS) } else { path.to_owned() };
    match splatting_avatar::is_export(&gaussians) {
        true => exported(&gaussians),
        false if path.is_dir() && !gaussians.is_file() => {
            let expected = "a 3DGS PLY, or a folder with point_cloud.ply and embedding.json";
            Err(Error::invalid(path, "avatar", "a folder without point_cloud.ply", expected))
        }
        false => stored(&gaussians),
    }
}

fn stored(path: &Path) -> Result<LoadedAvatar, Error> {
    let ply::Stored { avatar, body, comments, .. } = ply::read(path)?;
    let mut files = vec![path.to_owned()];
    files.extend(mesh_beside(path).into_iter().filter(|part| part.is_file()));
    Ok(LoadedAvatar {
        format: Format::Ply,
        avatar,
        canonical: None,
        body,
        comments,
        files,
        notes: Vec::new(),
    })
}

fn exported(path: &Path) -> Result<LoadedAvatar, Error> {
    let splatting_avatar::Exported { avatar, vertices, faces, files } = splatting_avatar::load(path)?;
    Ok(LoadedAvatar {
        format: Format::SplattingAvatar,
        avatar,
        canonical: Some(CanonicalMesh { vertices, faces }),
        body: None,
        comments: Vec::new(),
        files,
        notes: vec![
            "a SplattingAvatar export, its rotations carried from the canonical mesh to the rest pose".into(),
        ],
    })
}

/// Where the mesh of a hybrid is kept, beside the PLY of its Gaussians: the texture (`.texture.png`) and the vertices in
/// the rest pose (`.vertices.npy`).
pub fn mesh_beside(avatar: &Path) -> [PathBuf; 2] {
    [avatar.with_extension("texture.png"), avatar.with_extension("vertices.npy")]
}

impl LoadedAvatar {
    /// True if the files say how the Gaussians hang on a body.
    pub fn is_bound(&self) -> bool {
        self.avatar.binding != Binding::Static
    }

    /// SHA-256 of all its files, in hexadecimal; of a single file that of its bytes.
    ///
    /// # Errors
    /// A file that cannot be read again.
    pub fn digest(&self) -> Result<String, Error> {
        let digests = self.files.iter().map(|file| file_digest(file)).collect::<Result<Vec<_>, _>>()?;
        Ok(match digests.as_slice() {
            [one] => one.clone(),
            several => hexadecimal(Sha256::digest(several.concat())),
        })
    }
}

/// SHA-256 of a file's bytes, in hexadecimal.
///
/// # Errors
/// A file that cannot be read.
pub fn file_digest(path: &Path) -> Result<String, Error> {
    Ok(hexadecimal(Sha256::digest(error::read_bytes(path, "content", "a readable file")?)))
}

fn hexadecimal(digest: impl AsRef<[u8]>) -> String {
    digest.as_ref().iter().map(|byte| format!("{byte:02x}")).collect()
}
