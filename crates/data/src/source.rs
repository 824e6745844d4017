//! Opening what is read: regular files, and streams that are open already (`/dev/stdin`, `<(command)` of a shell). A named pipe
//! would be waited for and a device may have no end, wherever their names come from.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// What a stream may deliver: it has no length of its own, and some never end.
const MAX_STREAM: u64 = 1 << 32;

/// What a file of text may hold: no list of frames, table or mesh is as long.
const MAX_TEXT: u64 = 1 << 30;

/// Folders of streams that are open already.
const STREAMS: [&str; 3] = ["/dev/stdin", "/dev/fd", "/proc/self/fd"];

/// Opens a file to read.
///
/// # Errors
/// As the system; what is neither a regular file nor an open stream.
pub fn open(path: &Path) -> io::Result<File> {
    let about = std::fs::metadata(path)?;
    let is_stream = STREAMS.iter().any(|folder| path.starts_with(folder));
    match about.is_file() || (is_stream && !about.is_dir()) {
        true => File::open(path),
        false => Err(io::Error::new(io::ErrorKind::InvalidInput, kind(&about))),
    }
}

/// Reads a whole file.
///
/// # Errors
/// As [`open`]; a stream without an end within 4 GiB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_at_most(path, None)
}

/// Reads the bytes of a whole file of text.
///
/// # Errors
/// As [`read`]; more than 1 GiB.
pub(crate) fn read_text(path: &Path) -> io::Result<Vec<u8>> {
    read_at_most(path, Some(MAX_TEXT))
}

fn read_at_most(path: &Path, most: Option<u64>) -> io::Result<Vec<u8>> {
    let too_large = |most: u64| {
        let problem = format!("more than {} GiB", most >> 30);
        io::Error::new(io::ErrorKind::FileTooLarge, problem)
    };
    let mut file = open(path)?;
    let about = file.metadata()?;
    if let Some(most) = most.filter(|&most| about.len() > most) {
        return Err(too_large(most));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(about.len()).unwrap_or(0));
    let most = most.unwrap_or(if about.is_file() { u64::MAX } else { MAX_STREAM });
    if (&mut file).take(most.saturating_add(1)).read_to_end(&mut bytes)? as u64 > most {
        return Err(too_large(most));
    }
    Ok(bytes)
}

/// Reads a whole UTF-8 file.
///
/// # Errors
/// As [`read`]; more than 1 GiB, bytes that are no UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    String::from_utf8(read_text(path)?)
        .map_err(|cause| io::Error::new(io::ErrorKind::InvalidData, cause.to_string()))
}

fn kind(about: &Metadata) -> &'static str {
    match about.is_dir() {
        true => "a folder, not a regular file",
        false => "not a regular file, but a device, pipe or socket",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        assert_eq!(open(&path).unwrap_err().kind(), io::ErrorKind::NotFound);
        std::fs::write(&path, "text").unwrap();
        assert_eq!((read(&path).unwrap(), read_to_string(&path).unwrap()), (b"text".to_vec(), "text".into()));
        std::fs::write(&path, [0xff]).unwrap();
        assert_eq!(read_to_string(&path).unwrap_err().kind(), io::ErrorKind::InvalidData);
        assert!(open(folder.path()).unwrap_err().to_string().contains("a folder"));
        // Without its bytes on the disk, and none of them read.
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read_to_string(&path).unwrap_err().to_string(), "more than 1 GiB");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_are_refused_and_open_streams_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        for path in [path.as_path(), Path::new("/dev/zero")] {
            assert!(read(path).unwrap_err().to_string().contains("not a regular file"));
        }
        let (mut reader, mut writer) = io::pipe().unwrap();
        io::Write::write_all(&mut writer, b"text").unwrap();
        drop(writer);
        let number = std::os::fd::AsRawFd::as_raw_fd(&reader);
        assert_eq!(read(Path::new(&format!("/dev/fd/{number}"))).unwrap(), b"text");
        assert_eq!(reader.read(&mut [0]).unwrap(), 0);
    }
}
