//! Avatars whoever made them: which format is this?
//!
//! [`read_avatar`] tells formats apart by what is there, not by what a file is called. A further format is a file here and
//! a line in `READERS`.

mod checkpoint;
mod exported;
mod haha;
mod npz;
mod plain;
mod splats;
mod start;
mod unread;

use super::{Error, error, splatting_avatar};
use glam::DVec3;
use sha2::{Digest, Sha256};
use skinsplat_core::scene::{Avatar, Binding, Image};
use start::Start;
use std::path::{Path, PathBuf};

/// How an avatar is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A 3DGS PLY, with or without a binding ([`ply`](super::ply)).
    Ply,
    /// SuperSplat's compressed PLY.
    CompressedPly,
    /// The PLY of iHuman, whose values are activated.
    IHumanPly,
    /// An export of SplattingAvatar ([`splatting_avatar`]).
    SplattingAvatar,
    /// Named arrays of canonical Gaussians, as the exporters of `experiments/exporters` write them.
    Npz,
    /// Tensors of Gaussians in a torch file, under the names of 3DGS, gsplat or nerfstudio.
    Checkpoint,
    /// A checkpoint of HAHA: Gaussians on faces, and a texture for the body's mesh.
    Haha,
    /// glTF with KHR_gaussian_splatting.
    Gltf,
}

impl Format {
    /// Its name in prose.
    pub fn title(self) -> &'static str {
        match self {
            Self::Ply => "3DGS PLY",
            Self::CompressedPly => "SuperSplat compressed PLY",
            Self::IHumanPly => "iHuman PLY (activated values)",
            Self::SplattingAvatar => "SplattingAvatar export",
            Self::Npz => "npz of canonical Gaussians",
            Self::Checkpoint => "torch checkpoint of Gaussians",
            Self::Haha => "HAHA checkpoint",
            Self::Gltf => "glTF Gaussians (KHR_gaussian_splatting)",
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

/// A pose of a body model whose rest rotations are the identity (SMPL).
#[derive(Clone, Debug, PartialEq)]
pub struct CanonicalPose {
    /// Axis-angle vectors, radians, one per joint from the root on; joints that are not named rest.
    pub axis_angles: Vec<DVec3>,
    /// Added to every vertex, metres.
    pub translation: DVec3,
}

/// Where an avatar's means and rotations are measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Canonical {
    /// On the body in its rest pose.
    #[default]
    Rest,
    /// Means on the binding, rotations on this mesh.
    Mesh(CanonicalMesh),
    /// On the body in this pose.
    Pose(CanonicalPose),
    /// In HAHA's frame of each Gaussian's face: means and scales also in units of the size of the face.
    Faces,
}

/// An avatar as its files have it.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedAvatar {
    /// How it is stored.
    pub format: Format,
    /// The Gaussians and their binding: [`Binding::Static`] if the files name none.
    pub avatar: Avatar,
    /// Where the Gaussians are measured.
    pub canonical: Canonical,
    /// The texture of the body's mesh, which is drawn with the Gaussians; first row at the top (v = 1).
    pub texture: Option<Image>,
    /// Shape of the person, if the files hold one.
    pub betas: Option<Vec<f64>>,
    /// The body model that it was bound to, as the writer named it.
    pub body: Option<String>,
    /// Comments of the writer.
    pub comments: Vec<String>,
    /// Every file that belongs to it, the Gaussians' first.
    pub files: Vec<PathBuf>,
    /// What in the files was not read: names of properties, arrays or tensors.
    pub ignored: Vec<String>,
    /// What whoever uses it has to know, a clause each.
    pub notes: Vec<String>,
}

/// A format: how it is recognised, how it is read.
struct Reader {
    recognises: fn(&Start) -> bool,
    read: fn(&Start) -> Result<LoadedAvatar, Error>,
}

/// Every format; the first that recognises a file reads it.
const READERS: [Reader; 5] =
    [exported::READER, plain::READER, npz::READER, checkpoint::READER, splats::READER];

const EXPECTED: &str = "a 3DGS PLY, a SplattingAvatar export, an npz of Gaussians (README of skinsplat-data), a torch \
                        checkpoint of Gaussians or a glTF file with KHR_gaussian_splatting";

/// Reads an avatar: a PLY of Gaussians, an export of SplattingAvatar (`point_cloud.ply` with `embedding.json` beside it, or
/// the folder that holds both), an `.npz` of canonical Gaussians, a torch checkpoint, or a glTF file with
/// KHR_gaussian_splatting.
///
/// # Errors
/// A file of another format, by its name; a folder without an avatar; whatever the format's reader finds wrong.
pub fn read_avatar(path: &Path) -> Result<LoadedAvatar, Error> {
    let gaussians = if path.is_dir() { within(path)? } else { path.to_owned() };
    let start = Start::of(&gaussians)?;
    match READERS.iter().find(|reader| (reader.recognises)(&start)) {
        Some(reader) => (reader.read)(&start),
        None => Err(unread::refusal(&start)),
    }
}

/// The file of the Gaussians in a folder: `point_cloud.ply`, or that of the last iteration of a 3DGS output.
fn within(folder: &Path) -> Result<PathBuf, Error> {
    let own = folder.join(splatting_avatar::GAUSSIANS);
    if own.is_file() {
        return Ok(own);
    }
    let iteration = |entry: std::fs::DirEntry| {
        let number = entry.file_name().to_str()?.strip_prefix("iteration_")?.parse::<u64>().ok()?;
        let file = entry.path().join(splatting_avatar::GAUSSIANS);
        file.is_file().then_some((number, file))
    };
    let places = [folder.join("point_cloud"), folder.to_owned()];
    let entries = places.iter().filter_map(|place| std::fs::read_dir(place).ok()).flatten().flatten();
    let (_, file) = entries.filter_map(iteration).max_by_key(|(number, _)| *number).ok_or_else(|| {
        let expected = "a 3DGS PLY, or a folder with point_cloud.ply and embedding.json";
        Error::invalid(folder, "avatar", "a folder without point_cloud.ply", expected)
    })?;
    Ok(file)
}

/// Where the mesh of a hybrid is kept, beside the PLY of its Gaussians: the texture (`.texture.png`) and the vertices in
/// the rest pose (`.vertices.npy`).
pub fn mesh_beside(avatar: &Path) -> [PathBuf; 2] {
    [avatar.with_extension("texture.png"), avatar.with_extension("vertices.npy")]
}

impl LoadedAvatar {
    /// Gaussians from one file, with nothing to be said of them.
    fn new(format: Format, avatar: Avatar, file: &Path) -> Self {
        Self {
            format,
            avatar,
            canonical: Canonical::Rest,
            texture: None,
            betas: None,
            body: None,
            comments: Vec::new(),
            files: vec![file.to_owned()],
            ignored: Vec::new(),
            notes: Vec::new(),
        }
    }

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
