//! The targets, for the programs in `fuzz_targets/`.

pub mod targets;

/// Where the repository is.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Runs the target of this name on bytes, in a folder that lives as long as the process.
///
/// # Panics
/// If there is no such target, or no place for a folder.
pub fn run(name: &str, bytes: &[u8]) {
    use std::sync::OnceLock;
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| tempfile::tempdir().expect("a temporary folder"));
    let all = targets::TARGETS.iter().chain([&targets::CHECKPOINT]);
    all.into_iter().find(|target| target.name == name).expect("a target").run(folder.path(), bytes);
}
