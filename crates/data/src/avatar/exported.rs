//! Exports of SplattingAvatar.

use super::super::{Error, splatting_avatar};
use super::start::Start;
use super::{Canonical, CanonicalMesh, Format, LoadedAvatar, Reader};

pub(super) const READER: Reader =
    Reader { recognises: |start| splatting_avatar::is_export(&start.path), read };

fn read(start: &Start) -> Result<LoadedAvatar, Error> {
    let splatting_avatar::Exported { avatar, vertices, faces, files } = splatting_avatar::load(&start.path)?;
    Ok(LoadedAvatar {
        canonical: Canonical::Mesh(CanonicalMesh { vertices, faces }),
        files,
        notes: vec![
            "a SplattingAvatar export, its rotations carried from the canonical mesh to the rest pose".into(),
        ],
        ..LoadedAvatar::new(Format::SplattingAvatar, avatar, &start.path)
    })
}
