//! The targets of cargo-fuzz on the stable toolchain: every file of the corpus, and seeded mutations of it. None panics, none
//! takes longer than five seconds, none allocates more than 64 MB beyond what the file could hold.
//! `SKINSPLAT_MUTATIONS=1000000 SKINSPLAT_SEED=1 cargo test --release --test fuzz_corpus -- --nocapture` tries a million.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]
#![allow(unsafe_code, reason = "an allocator that counts")]
#![allow(unreachable_pub, dead_code, reason = "targets are written for another crate")]

#[path = "../fuzz/src/targets.rs"]
mod targets;

use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use targets::{CHECKPOINT, TARGETS, Target};

/// Where the repository is.
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, which counts what is allocated now and at most.
struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        grown(size);
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

fn grown(size: usize) {
    let now = NOW.fetch_add(size, Ordering::Relaxed) + size;
    PEAK.fetch_max(now, Ordering::Relaxed);
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Bytes beyond what a file could hold.
const MEMORY: usize = 64 << 20;
/// What deflate makes of a byte at most.
const EXPANSION: usize = 1032;
const TIME: Duration = Duration::from_secs(5);

/// Runs a target on bytes; what is wrong with it, if anything is.
fn tried(target: &Target, folder: &Path, bytes: &[u8]) -> Result<(), String> {
    let before = NOW.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let start = Instant::now();
    let ended = catch_unwind(AssertUnwindSafe(|| target.run(folder, bytes)));
    let (took, held) = (start.elapsed(), PEAK.load(Ordering::Relaxed).saturating_sub(before));
    match ended {
        Err(_) => Err("a panic".to_owned()),
        Ok(()) if took > TIME => Err(format!("{took:?}")),
        Ok(()) if held > MEMORY + EXPANSION * bytes.len() => Err(format!("{held} bytes of memory")),
        Ok(()) => Ok(()),
    }
}

/// As [`tried`]; the bytes of a failure are kept.
fn check(target: &Target, folder: &Path, bytes: &[u8], what: &str) {
    if let Err(problem) = tried(target, folder, bytes) {
        let kept = std::env::temp_dir().join(format!("skinsplat-fuzz-{}-{}", target.name, bytes.len()));
        std::fs::write(&kept, bytes).unwrap();
        panic!("{}: {what}: {problem}; the bytes are in {}", target.name, kept.display());
    }
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }
}

/// Numbers that are hard on readers, as text and as little-endian bytes.
const TEXTS: [&str; 14] = [
    "0",
    "-1",
    "1",
    "255",
    "65536",
    "1000000000",
    "4294967295",
    "18446744073709551615",
    "1e154",
    "1e308",
    "1e309",
    "-0.0",
    "NaN",
    "[]",
];
const WORDS: [u64; 10] = [
    0,
    1,
    0xFF,
    0x7FFF_FFFF,
    0xFFFF_FFFF,
    u64::MAX,
    0x7FF0_0000_0000_0000,
    0x7FF8_0000_0000_0000,
    0x5FF0_0000_0000_0000,
    0x7F80_0000,
];

/// Changes bytes in one to four places.
fn mutated(original: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len());
        match random.below(9) {
            _ if bytes.is_empty() => return bytes,
            0 | 1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes[at] = random.next() as u8,
            3 => {
                let word = WORDS[random.below(WORDS.len())].to_le_bytes();
                let end = (at + [1, 2, 4, 8][random.below(4)]).min(bytes.len());
                bytes[at..end].copy_from_slice(&word[..end - at]);
            }
            4 => bytes.truncate(at),
            5 => {
                let end = (at + 1 + random.below(16)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            6 => {
                let end = (at + 1 + random.below(16)).min(bytes.len());
                bytes.drain(at..end);
            }
            7 => {
                let from = random.below(other.len());
                let end = (from + 1 + random.below(32)).min(other.len());
                bytes.splice(at..at, other[from..end].iter().copied());
            }
            _ => replace_number(&mut bytes, random),
        }
    }
    bytes
}

/// Replaces a run of decimal digits.
fn replace_number(bytes: &mut Vec<u8>, random: &mut Random) {
    let begins = |&i: &usize| bytes[i].is_ascii_digit() && (i == 0 || !bytes[i - 1].is_ascii_digit());
    let starts: Vec<usize> = (0..bytes.len()).filter(begins).collect();
    let Some(&start) = starts.get(random.below(starts.len())) else { return };
    let end = (start..bytes.len()).find(|&i| !bytes[i].is_ascii_digit()).unwrap_or(bytes.len());
    bytes.splice(start..end, TEXTS[random.below(TEXTS.len())].bytes());
}

/// A mutation that readers look behind the checksum of: of an entry of a zip archive, of a chunk of a PNG.
fn mutated_inside(original: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    if original.starts_with(b"PK") {
        return mutated_entry(original, random);
    }
    original.starts_with(b"\x89PNG").then(|| mutated_chunk(original, random))
}

fn mutated_entry(original: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    use std::io::{Cursor, Read, Write};
    let mut archive = zip::ZipArchive::new(Cursor::new(original)).ok()?;
    let chosen = random.below(archive.len());
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for i in 0..archive.len() {
        let mut entry = archive.by_index(i).ok()?;
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).ok()?;
        if i == chosen {
            bytes = mutated(&bytes.clone(), &bytes, random);
        }
        writer.start_file(entry.name().ok()?.into_owned(), stored).ok()?;
        writer.write_all(&bytes).ok()?;
    }
    Some(writer.finish().ok()?.into_inner())
}

fn mutated_chunk(original: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = original.to_vec();
    let mut at = 8;
    let mut chunks = Vec::new();
    while at + 12 <= bytes.len() {
        let length = u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        if at + 12 + length > bytes.len() {
            break;
        }
        chunks.push((at + 8, length));
        at += 12 + length;
    }
    let (start, length) = chunks[random.below(chunks.len())];
    if length > 0 {
        for _ in 0..=random.below(3) {
            bytes[start + random.below(length)] = random.next() as u8;
        }
    }
    let sum = crc32(&bytes[start - 4..start + length]).to_be_bytes();
    bytes[start + length..start + length + 4].copy_from_slice(&sum);
    bytes
}

/// CRC-32 of PNG, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

/// One test, so that no other allocates while it counts.
#[test]
fn the_corpus_and_its_mutations_are_answered() {
    let number = |name, usual| std::env::var(name).map_or(usual, |text| text.parse().expect("a number"));
    let count = number("SKINSPLAT_MUTATIONS", 2_000_usize);
    let folder = tempfile::tempdir().unwrap();
    let mut seeds: Vec<(Target, Vec<Vec<u8>>)> = TARGETS
        .iter()
        .map(|target| {
            (*target, targets::corpus(target).iter().map(|file| std::fs::read(file).unwrap()).collect())
        })
        .collect();
    let tensors = br#"{"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}"#;
    let mut file = (tensors.len() as u64).to_le_bytes().to_vec();
    file.extend(tensors);
    file.extend([0; 4]);
    for (target, files) in &mut seeds {
        if target.name == "safetensors" {
            files.push(file.clone());
        }
        assert!(!files.is_empty(), "{}: no corpus", target.name);
    }
    seeds.push((CHECKPOINT, vec![targets::checkpoint_seed()]));
    for (target, files) in &seeds {
        files
            .iter()
            .enumerate()
            .for_each(|(i, bytes)| check(target, folder.path(), bytes, &format!("file {i}")));
    }
    let mut random = Random(number("SKINSPLAT_SEED", 7) as u64);
    for number in 0..count {
        let (target, files) = &seeds[random.below(seeds.len())];
        let [file, other] = [&files[random.below(files.len())], &files[random.below(files.len())]];
        let inside = if random.below(2) == 0 { mutated_inside(file, &mut random) } else { None };
        let bytes = inside.unwrap_or_else(|| mutated(file, other, &mut random));
        check(target, folder.path(), &bytes, &format!("mutation {number}"));
    }
    eprintln!("{count} mutations of {} files", seeds.iter().map(|(_, files)| files.len()).sum::<usize>());
}
