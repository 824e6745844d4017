//! Gaussians in glTF files (KHR_gaussian_splatting).

use super::super::{Error, error, gltf};
use super::start::Start;
use super::{Format, LoadedAvatar, Reader};

pub(super) const READER: Reader = Reader { recognises, read };

/// A glTF file with the attributes of the extension; other glTF files are bodies.
fn recognises(start: &Start) -> bool {
    let is_gltf = start.bytes.starts_with(b"glTF") || start.extension() == "gltf";
    let whole = || error::read_bytes(&start.path, "avatar", "a glTF file");
    start.is_file && is_gltf && whole().is_ok_and(|bytes| gltf::has_splats(&bytes))
}

fn read(start: &Start) -> Result<LoadedAvatar, Error> {
    let gltf::Splats { avatar, notes } = gltf::load_splats(&start.path)?;
    Ok(LoadedAvatar { notes, ..LoadedAvatar::new(Format::Gltf, avatar, &start.path) })
}
