//! Opening what is read: regular files, and streams that are open already (`/dev/stdin`, `<(command)` of a shell). A named pipe
//! would be waited for and a device may have no end, wherever their names come from.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// What a stream may deliver: it has no length of its own, and some never end.
const MAX_STREAM: u64 = 1 << 32;

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
    let mut file = open(path)?;
    let about = file.metadata()?;
    let mut bytes = Vec::with_capacity(usize::try_from(about.len()).unwrap_or(0));
    if about.is_file() {
        file.read_to_end(&mut bytes)?;
    } else if (&mut file).take(MAX_STREAM).read_to_end(&mut bytes)? as u64 == MAX_STREAM {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "no end within 4 GiB"));
    }
    Ok(bytes)
}

/// Reads a whole UTF-8 file.
///
/// # Errors
/// As [`read`]; bytes that are no UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path)?)
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
