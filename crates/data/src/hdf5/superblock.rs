//! Where an HDF5 file should end, by its superblock: a copy that was cut off is told as what it is.

use std::io::Read;

/// How a file of this format starts.
const SIGNATURE: &[u8; 8] = b"\x89HDF\r\n\x1a\n";

/// Bytes that the longest superblock has before and in the address of the file's end.
const MOST: u64 = 64;

/// What is wrong with a file of so many bytes, if it is shorter than its superblock says, or than a superblock. Nothing is said
/// of files that start otherwise, and of superblocks that are not known: reading them says more.
pub(super) fn cut_short(file: impl Read, length: u64) -> Option<String> {
    let mut start = Vec::new();
    file.take(MOST).read_to_end(&mut start).ok()?;
    if start.is_empty() {
        return Some("an empty file".to_owned());
    }
    let rest = start.strip_prefix(SIGNATURE)?;
    match declared_end(rest) {
        Declared::End(end) if length < end => Some(format!(
            "the file ends early, after {length} of the {end} bytes that its superblock declares"
        )),
        Declared::CutOff => Some(format!("the file ends early, within its superblock, after {length} bytes")),
        Declared::End(_) | Declared::Unknown => None,
    }
}

/// What a superblock says of the file's end.
enum Declared {
    End(u64),
    /// The file ends before it.
    CutOff,
    /// A version or a width of addresses that nobody writes.
    Unknown,
}

/// Reads a superblock from behind the signature on.
fn declared_end(rest: &[u8]) -> Declared {
    // Where the width of addresses is, and where addresses begin: base, another one, end.
    let (width, addresses) = match rest.first() {
        None => return Declared::CutOff,
        Some(0) => (5, 16),
        Some(1) => (5, 20),
        Some(2 | 3) => (1, 4),
        Some(_) => return Declared::Unknown,
    };
    let Some(&width) = rest.get(width) else { return Declared::CutOff };
    let width = usize::from(width);
    if ![2, 4, 8].contains(&width) {
        return Declared::Unknown;
    }
    let end = addresses + 2 * width;
    let Some(bytes) = rest.get(end..end + width) else { return Declared::CutOff };
    let value = bytes.iter().rev().fold(0u64, |value, &byte| value << 8 | u64::from(byte));
    let undefined = bytes.iter().all(|&byte| byte == 0xff);
    if undefined { Declared::Unknown } else { Declared::End(value) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A superblock of a version with addresses of 8 bytes and this end.
    fn superblock(version: u8, end: u64) -> Vec<u8> {
        let mut bytes = SIGNATURE.to_vec();
        bytes.extend(match version {
            0 => [&[0, 0, 0, 0, 0, 8, 8, 0][..], &[0; 8]].concat(),
            1 => [&[1, 0, 0, 0, 0, 8, 8, 0][..], &[0; 12]].concat(),
            _ => vec![version, 8, 8, 0],
        });
        bytes.extend(0u64.to_le_bytes());
        bytes.extend(u64::MAX.to_le_bytes());
        bytes.extend(end.to_le_bytes());
        bytes
    }

    #[test]
    fn a_file_that_is_shorter_than_it_says_is_told() {
        for version in 0..4 {
            let whole = superblock(version, 1000);
            assert_eq!(cut_short(&whole[..], 1000), None, "{version}");
            assert_eq!(cut_short(&whole[..], 2000), None, "{version}");
            let said = cut_short(&whole[..], 700).unwrap();
            assert!(said.contains("after 700 of the 1000 bytes"), "{said}");
            let within = whole.len() - 3;
            let said = cut_short(&whole[..within], within as u64).unwrap();
            assert!(said.contains("within its superblock"), "{said}");
            assert_eq!(cut_short(&superblock(version, u64::MAX)[..], 10), None, "{version}");
        }
        assert_eq!(cut_short(&superblock(9, 1000)[..], 700), None);
        assert_eq!(cut_short(&b"no such file"[..], 12), None);
        assert!(cut_short(&b""[..], 0).is_some());
    }
}
