//! Body models: SMPL-style `.npz` and `.pkl`, and skinned glTF 2.0, told apart by content.

mod shape;
mod smpl;
mod winding;

pub use shape::shape;

use super::error::disguise;
use super::{Error, gltf, pickle, source};
use skinsplat_core::scene::Body;
use std::io::Read;
use std::path::Path;

/// The arrays that are read of an SMPL-style `.npz` or `.pkl`.
pub const ARRAYS: [&str; 16] = [
    "v_template",
    "f",
    "faces",
    "J",
    "J_regressor",
    "weights",
    "kintree_table",
    "joint_names",
    "vt",
    "ft",
    "posedirs",
    "shapedirs",
    "hands_meanl",
    "hands_meanr",
    "hands_componentsl",
    "hands_componentsr",
];

/// A body model, and what has to be said of how it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The model.
    pub body: Body,
    /// What was guessed, repaired or left out, a clause each.
    pub notes: Vec<String>,
}

/// Loads a body model: SMPL, SMPL-H or SMPL-X (or one in their layout, of any number of vertices) as `.npz` or as the
/// original `.pkl`, or a skinned glTF 2.0 file.
///
/// # Errors
/// A file that is none of them, or whose content is not a consistent body; a pickle that names a class that is not read.
pub fn read(path: &Path) -> Result<Loaded, Error> {
    let mut loaded = match Format::of(path)? {
        Format::Npz | Format::Pickle => smpl::load(path)?,
        Format::Gltf => {
            let gltf::Rig { body, notes, .. } = gltf::Rig::load(path)?;
            Loaded { body, notes }
        }
    };
    loaded.notes.extend(winding::note(&loaded.body.rest).map_err(|e| Error::scene(path, e))?);
    Ok(loaded)
}

/// The model of [`read`] alone.
///
/// # Errors
/// As [`read`].
pub fn load(path: &Path) -> Result<Body, Error> {
    read(path).map(|loaded| loaded.body)
}

/// What a body or pose file is, judged by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Npz,
    Pickle,
    Gltf,
}

impl Format {
    pub(super) fn of(path: &Path) -> Result<Self, Error> {
        let expected = "an .npz, .pkl, .glb or .gltf file";
        let unreadable = |cause| Error::read(path, "file", expected, cause);
        let mut start = Vec::new();
        source::open(path).map_err(unreadable)?.take(64).read_to_end(&mut start).map_err(unreadable)?;
        let text = start.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&start).trim_ascii_start();
        if start.starts_with(b"PK") {
            Ok(Self::Npz)
        } else if start.starts_with(b"glTF") || text.starts_with(b"{") {
            Ok(Self::Gltf)
        } else if pickle::is_pickle_file(path, &start) {
            Ok(Self::Pickle)
        } else {
            Err(Error::invalid(path, "file", disguise(&start).unwrap_or("unknown format"), expected))
        }
    }
}
