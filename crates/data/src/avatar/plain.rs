//! PLY files in every dialect of [`ply`].

use super::super::{Error, ply};
use super::start::Start;
use super::{Format, LoadedAvatar, Reader, mesh_beside};
use ply::Dialect;

pub(super) const READER: Reader = Reader { recognises, read };

/// What starts like a PLY, what is called one and is nothing else that is known, and any pipe.
fn recognises(start: &Start) -> bool {
    !start.is_file
        || start.bytes.starts_with(b"ply")
        || (start.extension() == "ply" && !super::unread::is_known(start))
}

fn read(start: &Start) -> Result<LoadedAvatar, Error> {
    let path = &start.path;
    let ply::Stored { avatar, dialect, body, comments, ignored, notes, .. } = ply::read(path)?;
    let format = match dialect {
        Dialect::Standard => Format::Ply,
        Dialect::Compressed => Format::CompressedPly,
        Dialect::Activated => Format::IHumanPly,
    };
    let mut loaded =
        LoadedAvatar { body, comments, ignored, notes, ..LoadedAvatar::new(format, avatar, path) };
    loaded.files.extend(mesh_beside(path).into_iter().filter(|part| part.is_file()));
    Ok(loaded)
}
