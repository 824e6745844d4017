//! Which layouts read a file, by where it lies and what it is called.

use super::contents::{contents, fits};
use super::{LAYOUTS, Layout, Part};
use std::cmp::Reverse;
use std::path::Path;

/// A layout that reads a file, and as what.
#[derive(Clone, Copy, Debug)]
pub struct Reader {
    /// The layout.
    pub layout: &'static Layout,
    /// What the file is in it.
    pub part: &'static Part,
    /// How many names of the place fit, the file's own the first.
    depth: usize,
    /// True if all of them do.
    whole: bool,
}

/// The layouts that read a file of this path. Those of which more of the place fits go before others, and the layout that the
/// folder around the file has before all.
pub fn readers(path: &Path) -> Vec<Reader> {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let all = LAYOUTS.iter().flat_map(|layout| layout.parts.iter().map(move |part| (layout, part)));
    let mut found: Vec<Reader> = all.filter_map(|(layout, part)| fitting(&path, layout, part)).collect();
    let of_folder = |reader: &Reader| {
        let subject = path.ancestors().nth(reader.depth).filter(|_| reader.whole);
        subject.and_then(contents).is_some_and(|contents| contents.layout.id == reader.layout.id)
    };
    if found.iter().any(of_folder) {
        found.retain(of_folder);
    }
    let best = found.iter().map(rank).max();
    found.retain(|reader| Some(rank(reader)) == best);
    found
}

fn rank(reader: &Reader) -> (usize, bool, Reverse<usize>) {
    // Of places that fit alike, those without `*` are more telling.
    (reader.depth, reader.whole, Reverse(reader.part.place.matches('*').count()))
}

/// Whether a part of a layout is called as this file. A place that leaves its folders out must be a name that tells.
fn fitting(path: &Path, layout: &'static Layout, part: &'static Part) -> Option<Reader> {
    let names = path.ancestors().map_while(|path| path.file_name()?.to_str());
    let wanted: Vec<&str> = part.place.rsplit('/').collect();
    let depth = wanted.iter().zip(names).take_while(|(pattern, name)| fits(name, pattern)).count();
    let whole = depth == wanted.len();
    let named = depth > 0 && !wanted[0].contains('*');
    (whole || depth > 1 || named).then_some(Reader { layout, part, depth, whole })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_told_by_its_place() {
        let told = |path: &str| -> Vec<String> {
            readers(Path::new(path)).iter().map(|r| format!("{} {}", r.layout.id, r.part.what)).collect()
        };
        assert_eq!(told("x/camera.pkl"), ["peoplesnapshot-raw camera"]);
        assert_eq!(told("00016/train/Take4/render/cameras.npz"), ["xhumans training cameras"]);
        assert_eq!(told("00016/test/Take4/render/cameras.npz"), ["xhumans test cameras"]);
        assert_eq!(told("female-3/cameras.npz"), ["peoplesnapshot cameras"]);
        assert_eq!(told("x/smpl_optimized_aligned_scale.npz"), ["neuman poses"]);
        assert_eq!(told("x/test/a/SMPLX/mesh-f00011_smplx.pkl"), ["xhumans test poses"]);
        assert_eq!(told("seattle/alignments.npy"), ["neuman alignments"]);
        assert!(told("x/strange.npz").is_empty() && told("x/strange.pkl").is_empty());
        assert!(told("some/images/a.png").len() > 1, "images of several layouts");
    }
}
