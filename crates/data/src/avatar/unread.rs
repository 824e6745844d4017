//! Formats of splats that are known and not read: each is named, with the program that converts it.

use super::super::Error;
use super::start::Start;

/// A format that is not read.
struct Unread {
    recognises: fn(&Start) -> bool,
    /// What it is.
    name: &'static str,
    /// What to do.
    expected: &'static str,
}

/// How torch began its files before they were archives.
const OLD_TORCH: &[u8] = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19\x2e";
const CONVERTED: &str = "a PLY: splat-transform (npm: @playcanvas/splat-transform) converts it";

const UNREAD: [Unread; 12] = [
    Unread {
        recognises: |s| s.bytes.starts_with(b"version https://git-lfs"),
        name: "a pointer of Git LFS, not the file",
        expected: "the file itself: git lfs pull fetches it",
    },
    Unread {
        recognises: |s| {
            s.bytes.starts_with(b"NGSP") || (s.extension() == "spz" && s.bytes.starts_with(&[0x1f, 0x8b]))
        },
        name: "an .spz file (Niantic's compressed splats)",
        expected: CONVERTED,
    },
    Unread {
        recognises: |s| s.bytes.starts_with(&[0x1f, 0x8b]),
        name: "a gzip archive",
        expected: "the file inside it; an .spz (also gzip): a PLY that splat-transform makes of it",
    },
    Unread {
        recognises: |s| s.is_archive() && s.has_entry("meta.json"),
        name: "a .sog archive (PlayCanvas's compressed splats)",
        expected: CONVERTED,
    },
    Unread {
        recognises: |s| s.extension() == "json" && s.path.file_name().is_some_and(|name| name == "meta.json"),
        name: "the index of unpacked SOG splats",
        expected: CONVERTED,
    },
    Unread {
        recognises: |s| s.extension() == "ksplat",
        name: "a .ksplat file (GaussianSplats3D)",
        expected: CONVERTED,
    },
    Unread {
        recognises: |s| s.extension() == "splat",
        name: "a .splat file (antimatter15's viewer: 8-bit colours, no SH)",
        expected: CONVERTED,
    },
    Unread {
        recognises: |s| s.bytes.starts_with(OLD_TORCH) || s.bytes.get(257..262) == Some(b"ustar"),
        name: "a torch file of the old form, which is no archive",
        expected: "the same saved anew: torch.save(torch.load(FILE), NEW) with torch 1.6 or later",
    },
    Unread {
        recognises: |s| s.bytes.starts_with(&[0x80]) && s.bytes.get(1).is_some_and(|v| (1..=5).contains(v)),
        name: "a Python pickle, which can run code and is not read",
        expected: "an npz of Gaussians or a PLY",
    },
    Unread {
        recognises: |s| s.bytes.starts_with(b"glTF") || s.extension() == "gltf",
        name: "a glTF file",
        expected: "a PLY of the avatar (a glTF body is for --body); splat-transform and others export its splats",
    },
    Unread {
        recognises: |s| s.bytes.starts_with(b"\x89HDF"),
        name: "an HDF5 file",
        expected: super::EXPECTED,
    },
    Unread {
        recognises: |s| s.extension() == "safetensors",
        name: "a .safetensors file",
        expected: "the same arrays saved with numpy.savez, under the names of the npz of Gaussians",
    },
];

/// True if the file is of a format that is known and not read, or an archive.
pub(super) fn is_known(start: &Start) -> bool {
    start.is_archive() || UNREAD.iter().any(|format| (format.recognises)(start))
}

/// Why the file is not read.
pub(super) fn refusal(start: &Start) -> Error {
    let known = UNREAD.iter().find(|format| (format.recognises)(start));
    let (name, expected) = match known {
        Some(format) => (format.name, format.expected),
        None if start.is_archive() && start.entries.is_empty() => {
            ("a zip archive that is damaged or empty", super::EXPECTED)
        }
        None if start.is_archive() => ("a zip archive of something else", super::EXPECTED),
        None if start.bytes.is_empty() => ("an empty file", super::EXPECTED),
        None => ("unknown format", super::EXPECTED),
    };
    Error::invalid(&start.path, "avatar", name, expected)
}
