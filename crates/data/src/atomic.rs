//! Writing a file so that a reader sees all of it or none: beside the target, then renamed. A program that is told to stop calls
//! [`abandon`], and leaves nothing half written.

use super::Error;
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How the names of files begin that are not complete yet.
const UNFINISHED: &str = ".writing-";

/// A file that nobody has written to for so long is left over from a program that was killed.
const ABANDONED: Duration = Duration::from_secs(3600);

/// Removes what programs left in a folder that were killed while they wrote: unfinished files that nobody has written to for an
/// hour. Others may be another process's. What cannot be removed stays.
pub fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let unfinished = entry.file_name().to_str().is_some_and(|name| name.starts_with(UNFINISHED));
        let idle = |metadata: std::fs::Metadata| {
            metadata.is_file()
                && metadata.modified().is_ok_and(|at| at.elapsed().is_ok_and(|idle| idle > ABANDONED))
        };
        if unfinished && entry.metadata().is_ok_and(idle) {
            // Another process may have swept it: that is as good.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Writes `path` through `fill`. A regular file appears complete or not at all, and replaces an older one at once; a
/// device or a pipe (`/dev/stdout`) is written to directly, since it must not be replaced.
///
/// # Errors
/// [`Error::Write`] for a missing or protected folder, a full disk, a path that is a folder. Nothing is left behind.
pub fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> Result<(), Error> {
    let written = match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => Err(io::Error::from(io::ErrorKind::IsADirectory)),
        Ok(metadata) if !metadata.is_file() => {
            OpenOptions::new().write(true).open(path).and_then(|f| filled(&f, fill))
        }
        _ => beside(path, fill),
    };
    written.map_err(|cause| Error::write(path, "file", cause))
}

/// Finds out whether [`write()`] could write there, before work is done that would be lost: nothing is left behind.
///
/// # Errors
/// As [`write()`], but for a disk that fills up.
pub fn check(path: &Path) -> Result<(), Error> {
    let tried = match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => Err(io::Error::from(io::ErrorKind::IsADirectory)),
        Ok(metadata) if !metadata.is_file() => Ok(()),
        _ => tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(folder_of(path)).map(|_| ()),
    };
    tried.map_err(|cause| Error::write(path, "file", cause))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn beside(path: &Path, fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> io::Result<()> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(UNFINISHED);
    #[cfg(unix)]
    {
        // The usual mode of a new file (the umask still applies), not the private one of a temporary file.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let (file, name) = {
        let mut unfinished = unfinished();
        let file = builder.tempfile_in(folder_of(path))?;
        let name = file.path().to_owned();
        unfinished.insert(name.clone());
        (file, name)
    };
    let written = filled(file.as_file(), fill).and_then(|()| {
        let _unfinished = unfinished();
        file.persist(path).map(|_| ()).map_err(|e| e.error)
    });
    unfinished().remove(&name);
    written
}

/// Files of this process that are not complete yet.
static UNFINISHED_FILES: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED_FILES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes every file that this process has not completed, and lets it begin and complete no other: for a process that ends
/// while its threads are still writing. Keep what is returned until it does.
pub fn abandon() -> impl Drop {
    let unfinished = unfinished();
    for path in unfinished.iter() {
        // One that cannot be removed is swept later.
        let _ = std::fs::remove_file(path);
    }
    unfinished
}

fn filled(file: &File, fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(1 << 18, file);
    fill(&mut writer)?;
    writer.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        write(&path, |w| w.write_all(b"first")).unwrap();
        let error = write(&path, |w| {
            w.write_all(b"half")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        })
        .unwrap_err();
        assert_eq!(error.path(), path);
        assert_eq!((std::fs::read(&path).unwrap(), entries(folder.path())), (b"first".to_vec(), 1));
        write(&path, |w| w.write_all(b"second")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
    }

    #[test]
    fn only_abandoned_files_are_swept() {
        let folder = tempfile::tempdir().unwrap();
        let old = std::time::SystemTime::now() - 2 * ABANDONED;
        for (name, age) in [(".writing-a", Some(old)), (".writing-b", None), ("kept", Some(old))] {
            let file = File::create(folder.path().join(name)).unwrap();
            if let Some(age) = age {
                file.set_modified(age).unwrap();
            }
        }
        sweep(folder.path());
        sweep(&folder.path().join("missing"));
        let left = |name| folder.path().join(name).exists();
        assert_eq!([left(".writing-a"), left(".writing-b"), left("kept")], [false, true, true]);
    }

    #[test]
    fn what_cannot_be_written_is_known_before() {
        let folder = tempfile::tempdir().unwrap();
        for path in [folder.path().join("missing/out.bin"), folder.path().to_path_buf()] {
            assert!(matches!(check(&path), Err(Error::Write { .. })));
        }
        check(&folder.path().join("out.bin")).unwrap();
        assert_eq!(entries(folder.path()), 0);
    }

    #[test]
    fn missing_folders_and_folders_as_targets_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        for path in [folder.path().join("missing/out.bin"), folder.path().to_path_buf()] {
            let error = write(&path, |w| w.write_all(b"x")).unwrap_err();
            assert!(matches!(error, Error::Write { .. }), "{error}");
        }
        assert_eq!(entries(folder.path()), 0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_device_is_an_error_and_stays_a_device() {
        let error = write(Path::new("/dev/full"), |w| w.write_all(&[0; 1 << 20])).unwrap_err();
        assert!(error.to_string().starts_with("/dev/full: file: cannot write"), "{error}");
        assert!(!std::fs::metadata("/dev/full").unwrap().is_file());
    }
}
