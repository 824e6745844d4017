//! How many bytes avatars take as a run keeps them.

use crate::experiment::{AvatarSource, Plan};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What an avatar may be made of, in the run's folder of avatars: Gaussians, a texture, the vertices under it.
const PARTS: [&str; 4] = ["ply", "npy", "texture.png", "vertices.npy"];

/// Bytes of the files of a plan's avatars, by key: of those that were made their parts in the run's folder, of others the file that
/// was given, or what the folder of renders says. Nothing of those that are not there, nor of whole folders.
pub(super) fn bytes<'p>(plan: &'p Plan, folder: &Path) -> BTreeMap<&'p str, u64> {
    let length = |path: &Path| std::fs::metadata(path).ok().filter(|of| of.is_file()).map(|of| of.len());
    let made = |key: &str| {
        let parts = PARTS.map(|part| folder.join(format!("{key}.{part}")));
        let lengths: Vec<u64> = parts.iter().filter_map(|part: &PathBuf| length(part)).collect();
        (!lengths.is_empty()).then(|| lengths.iter().sum())
    };
    let sized = plan.avatars.iter().filter_map(|avatar| {
        let bytes = match &avatar.source {
            AvatarSource::File { path, .. } => length(path),
            AvatarSource::Renders(renders) => renders.bytes,
            AvatarSource::Missing { .. } => None,
            AvatarSource::Surface { .. } | AvatarSource::Textured { .. } | AvatarSource::Fit { .. } => {
                made(&avatar.key)
            }
        };
        Some((avatar.key.as_str(), bytes?))
    });
    sized.collect()
}
