//! Body models: SMPL-style `.npz` and skinned glTF 2.0, told apart by content.

mod smpl;

use super::Error;
use skinsplat_core::scene::Body;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Loads a body model.
///
/// # Errors
/// A file that is neither `.npz`, `.glb` nor `.gltf`, or whose content is not a consistent body.
pub fn load(path: &Path) -> Result<Body, Error> {
    match Format::of(path)? {
        Format::Npz => smpl::load(path),
        Format::Gltf => super::gltf::Rig::load(path).map(|rig| rig.body),
    }
}

/// What a body or pose file is, judged by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Npz,
    Gltf,
}

impl Format {
    pub(super) fn of(path: &Path) -> Result<Self, Error> {
        let expected = "an .npz, .glb or .gltf file";
        let unreadable = |cause| Error::read(path, "file", expected, cause);
        let mut start = Vec::new();
        File::open(path).map_err(unreadable)?.take(64).read_to_end(&mut start).map_err(unreadable)?;
        let text = start.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&start).trim_ascii_start();
        if start.starts_with(b"PK") {
            Ok(Self::Npz)
        } else if start.starts_with(b"glTF") || text.starts_with(b"{") {
            Ok(Self::Gltf)
        } else if start.starts_with(b"\x80") {
            let problem = "a Python pickle, which can run code and is not read";
            Err(Error::invalid(path, "file", problem, "the same arrays saved with numpy.savez"))
        } else {
            Err(Error::invalid(path, "file", "unknown format", expected))
        }
    }
}
