//! Files of a folder, as frames are kept: in the order of their numbers, without hidden ones.
//!
//! A name that starts with a dot is no file of a data set: macOS writes `._image.png` beside every file on foreign drives.

use super::Error;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Component, Path, PathBuf};

/// The files of a folder that have one of the extensions, in the order of their numbers. `field` is what they are for ("images").
///
/// # Errors
/// A folder that cannot be read.
pub fn files(folder: &Path, field: &str, extensions: &[&str]) -> Result<Vec<PathBuf>, Error> {
    let wanted = format!("a folder of files ({})", extensions.join(", "));
    let fits = |path: &PathBuf| rank(path, extensions).is_some() && path.is_file();
    Ok(visible(folder, field, &wanted)?.into_iter().filter(fits).collect())
}

/// Names of pictures in a folder that are of kinds which nothing here reads, in the order of their numbers.
///
/// # Errors
/// A folder that cannot be read.
pub fn unread_pictures(folder: &Path) -> Result<Vec<String>, Error> {
    let kinds =
        ["webp", "bmp", "gif", "tif", "tiff", "exr", "hdr", "avif", "heic", "jxl", "jp2", "ppm", "tga"];
    Ok(files(folder, "frames", &kinds)?.iter().map(|path| file_name(path)).collect())
}

/// The folders in a folder, in the order of their numbers.
///
/// # Errors
/// A folder that cannot be read.
pub fn folders(folder: &Path, field: &str) -> Result<Vec<PathBuf>, Error> {
    let entries = visible(folder, field, "a folder of folders")?;
    Ok(entries.into_iter().filter(|path| path.is_dir()).collect())
}

/// No video has more frames: a name's number must not become a range of such a length.
const MAX_NUMBER: usize = 9_999_999;

/// The files of a folder by the number in their names: the last run of digits before the extension. Of two files with one
/// number, that whose extension comes first in `extensions` counts.
///
/// # Errors
/// A folder that cannot be read or holds no such file, a name without a number, two files with one number and extension.
pub(crate) fn numbered(
    folder: &Path,
    field: &str,
    extensions: &[&str],
) -> Result<BTreeMap<usize, PathBuf>, Error> {
    let mut found: BTreeMap<usize, PathBuf> = BTreeMap::new();
    for path in files(folder, field, extensions)? {
        let Some(number) = number_of(&path).filter(|number| *number <= MAX_NUMBER) else {
            let problem = format!("no number up to {MAX_NUMBER} in its name");
            return Err(Error::invalid(&path, field, problem, "a name like image_0012"));
        };
        match found.entry(number) {
            Entry::Vacant(place) => {
                place.insert(path);
            }
            Entry::Occupied(mut place) => match rank(&path, extensions).cmp(&rank(place.get(), extensions)) {
                Ordering::Less => drop(place.insert(path)),
                Ordering::Equal => {
                    let problem = format!("frame {number} too, as {} is", file_name(place.get()));
                    return Err(Error::invalid(&path, field, problem, "one file of a number"));
                }
                Ordering::Greater => {}
            },
        }
    }
    if found.is_empty() {
        let expected = format!("files with a number ({})", extensions.join(", "));
        return Err(Error::invalid(folder, field, "no file", expected));
    }
    Ok(found)
}

/// The number in a file's name: the last run of digits before the extension.
pub(crate) fn number_of(path: &Path) -> Option<usize> {
    let stem = path.file_stem()?.to_str()?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    stem.get(start..end)?.parse().ok()
}

/// A file's name without its extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// A file's or folder's own name.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Text order in which runs of digits count as the numbers that they are: `image_2` before `image_10`.
pub(crate) fn natural_order(a: &str, b: &str) -> Ordering {
    let digits = |text: &str| text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (mut x, mut y) = (a, b);
    loop {
        let (in_x, in_y) = (digits(x), digits(y));
        if in_x > 0 && in_y > 0 {
            let [p, q] = [&x[..in_x], &y[..in_y]].map(|run| run.trim_start_matches('0'));
            let order = p.len().cmp(&q.len()).then_with(|| p.cmp(q));
            if order != Ordering::Equal {
                return order;
            }
            (x, y) = (&x[in_x..], &y[in_y..]);
            continue;
        }
        let (mut rest_x, mut rest_y) = (x.chars(), y.chars());
        match (rest_x.next(), rest_y.next()) {
            (None, None) => return a.cmp(b),
            (p, q) if p != q => return p.cmp(&q),
            _ => (x, y) = (rest_x.as_str(), rest_y.as_str()),
        }
    }
}

/// What a folder holds but hidden entries, in [`natural_order`] of the names.
fn visible(folder: &Path, field: &str, expected: &str) -> Result<Vec<PathBuf>, Error> {
    let entries = std::fs::read_dir(folder).map_err(|cause| Error::read(folder, field, expected, cause))?;
    let mut named: Vec<(String, PathBuf)> = entries
        .filter_map(|entry| {
            let entry = entry.ok()?;
            Some((entry.file_name().into_string().ok()?, entry.path()))
        })
        .filter(|(name, _)| !name.starts_with('.'))
        .collect();
    named.sort_by(|(a, _), (b, _)| natural_order(a, b));
    Ok(named.into_iter().map(|(_, path)| path).collect())
}

/// Which of the extensions a file has.
fn rank(path: &Path, extensions: &[&str]) -> Option<usize> {
    let own = path.extension()?;
    extensions.iter().position(|extension| own.eq_ignore_ascii_case(extension))
}

/// Whether a path that a document names stays below a folder, or so many above it. Lexically: links may lead where they like,
/// since whoever set them could.
pub(crate) fn stays_inside(path: &str, above: usize) -> bool {
    let mut depth = above;
    for part in Path::new(path).components() {
        match part {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir if depth > 0 => depth -= 1,
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_files_are_no_frames() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["f_10.png", "f_2.PNG", "._f_1.png", "f_3.txt", "f_1.png"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = files(folder.path(), "images", &["png"]).unwrap();
        let names: Vec<String> = found.iter().map(|path| file_name(path)).collect();
        assert_eq!(names, ["f_1.png", "f_2.PNG", "f_10.png"]);
    }

    #[test]
    fn runs_of_digits_are_numbers() {
        let mut names = ["image_10", "image_9", "Take2", "image_009", "image", "image_10b", "Take11"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["Take2", "Take11", "image", "image_009", "image_9", "image_10", "image_10b"]);
        for (name, number) in
            [("a/image_0012.png", Some(12)), ("mesh-f00007_smplx.pkl", Some(7)), ("x.png", None)]
        {
            assert_eq!(number_of(Path::new(name)), number, "{name}");
        }
        assert_eq!(number_of(Path::new("99999999999999999999999.png")), None);
    }

    #[test]
    fn hidden_files_are_none_and_numbers_are_unique() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str| std::fs::write(folder.path().join(name), b"x").unwrap();
        ["._m_2.png", "m_10.png", "m_2.npy", "m_2.png", "note.txt"].into_iter().for_each(write);
        let found = numbered(folder.path(), "masks", &["npy", "png"]).unwrap();
        let names: Vec<_> = found.values().map(|path| file_name(path)).collect();
        assert_eq!(names, ["m_2.npy", "m_10.png"]);
        write("m_02.npy");
        let error = numbered(folder.path(), "masks", &["npy", "png"]).unwrap_err();
        assert!(error.to_string().contains("frame 2 too"), "{error}");
    }

    #[test]
    fn paths_of_documents_stay_where_they_belong() {
        for (path, above, inside) in [
            ("images/a.png", 0, true),
            ("./images/../a.png", 0, true),
            ("../images/a.png", 1, true),
            ("../images/a.png", 0, false),
            ("../../a.png", 1, false),
            ("images/../../a.png", 0, false),
            ("/etc/passwd", 3, false),
        ] {
            assert_eq!(stays_inside(path, above), inside, "{path}");
        }
    }
}
