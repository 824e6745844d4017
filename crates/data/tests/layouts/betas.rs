//! Shapes of other lengths than the body model's: the same in every layout, and said.

use super::names::copy;
use super::support_files::{Values, npy, npz};
use super::{SPLIT, load, model, place};
use skinsplat_data::Error;
use skinsplat_data::hdf5::Hdf5;
use skinsplat_data::npz::Archive;
use std::path::Path;

/// A copied folder with so many betas in its files.
type Rewrite = fn(&Path, &[f64]);

/// The layout, its folder, its body model, how betas are rewritten.
const LAYOUTS: [(&str, &str, &str, Rewrite); 7] = [
    ("neuman", "neuman/ava", "anny_smpl24.npz", |folder, betas| {
        archived(&folder.join("4d_humans/smpl_optimized_aligned_scale.npz"), betas, Rows::Eight)
    }),
    ("neuman", "neuman/ava", "anny_smpl24.npz", |folder, betas| {
        archived(&folder.join("4d_humans/smpl_optimized_aligned_scale.npz"), betas, Rows::None)
    }),
    ("peoplesnapshot", "peoplesnapshot/ava", "anny_smpl24.npz", |folder, betas| {
        std::fs::remove_dir_all(folder.join("poses")).unwrap();
        archived(&folder.join("poses.npz"), betas, Rows::None)
    }),
    ("peoplesnapshot", "peoplesnapshot/ava", "anny_smpl24.npz", |folder, betas| {
        std::fs::remove_dir_all(folder.join("poses")).unwrap();
        archived(&folder.join("poses.npz"), betas, Rows::One)
    }),
    ("peoplesnapshot-raw", "peoplesnapshot-raw/ava", "anny_smpl24.npz", |folder, betas| {
        stored(&folder.join("reconstructed_poses.hdf5"), betas, Rows::None)
    }),
    ("peoplesnapshot-raw", "peoplesnapshot-raw/ava", "anny_smpl24.npz", |folder, betas| {
        stored(&folder.join("reconstructed_poses.hdf5"), betas, Rows::One)
    }),
    ("xhumans", "xhumans/00099", "anny_smplx55.npz", |folder, betas| {
        let bytes = npy(&[betas.len() as u64], betas);
        std::fs::write(folder.join("mean_shape_smplx.npy"), bytes).unwrap();
    }),
];

/// The rows of betas in an archive.
#[derive(Clone, Copy)]
enum Rows {
    None,
    One,
    Eight,
}

impl Rows {
    /// The shape of an array with so many betas, and how often it holds them.
    fn of(self, width: u64) -> (Vec<u64>, usize) {
        match self {
            Self::None => (vec![width], 1),
            Self::One => (vec![1, width], 1),
            Self::Eight => (vec![8, width], 8),
        }
    }
}

fn archived(path: &Path, betas: &[f64], rows: Rows) {
    let mut archive = Archive::open(path, "poses").unwrap();
    let others: Vec<String> = archive.names().into_iter().filter(|name| name != "betas").collect();
    let arrays: Vec<_> = others.iter().map(|name| (name, archive.array(name).unwrap().unwrap())).collect();
    let shapes: Vec<Vec<u64>> =
        arrays.iter().map(|(_, array)| array.shape.iter().map(|&n| n as u64).collect()).collect();
    let (shape, count) = rows.of(betas.len() as u64);
    let mut fields = vec![("betas", &shape[..], Values::F64(betas.repeat(count)))];
    for ((name, array), shape) in arrays.iter().zip(&shapes) {
        fields.push((name.as_str(), &shape[..], Values::F64(array.values.clone())));
    }
    npz(path, &fields);
}

fn stored(path: &Path, betas: &[f64], rows: Rows) {
    let file = Hdf5::open(path, "poses").unwrap();
    let mut builder = hdf5_pure::FileBuilder::new();
    for (name, shape) in [("pose", [0, 72]), ("trans", [0, 3])] {
        let array = file.array(name, &shape).unwrap();
        let shape: Vec<u64> = array.shape.iter().map(|&n| n as u64).collect();
        builder.create_dataset(name).with_f64_data(&array.values).with_shape(&shape);
    }
    builder.create_dataset("betas").with_f64_data(betas).with_shape(&rows.of(betas.len() as u64).0);
    drop(file);
    builder.write(path).unwrap();
}

/// The height of the body and what is said of its shape.
fn loaded(
    (layout, from, body, rewrite): &(&str, &str, &str, Rewrite),
    betas: &[f64],
) -> Result<(f64, Vec<String>), Error> {
    let folder = tempfile::tempdir().unwrap();
    let subject = folder.path().join("ava");
    copy(&place(from), &subject);
    rewrite(&subject, betas);
    let subject = load(layout, &subject, model(body), Some(&SPLIT))?;
    let heights = subject.train[0].body.vertices.iter().map(|v| v.y);
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), y| (low.min(y), high.max(y)));
    let notes = subject.notes.into_iter().filter(|note| note.contains("betas")).collect();
    Ok((high - low, notes))
}

#[test]
fn betas_of_any_number_are_cut_or_filled_up_with_a_note() {
    let shape: Vec<f64> = (0..11).map(|i| 0.5 - 0.1 * f64::from(i)).collect();
    for layout in &LAYOUTS {
        let name = format!("{} {}", layout.0, layout.1);
        let of = |count: usize| {
            loaded(layout, &shape[..count]).unwrap_or_else(|error| panic!("{name}, {count}: {error}"))
        };
        let (whole, notes) = of(10);
        assert!(notes.is_empty(), "{name}: {notes:?}");
        let said = |count: usize, part: &str| {
            let (height, notes) = of(count);
            assert_eq!(notes.len(), 1, "{name}, {count}: {notes:?}");
            assert!(notes[0].contains(part), "{name}, {count}: {notes:?}");
            height
        };
        assert_eq!(said(11, "11 values for a model of 10 directions; the last 1 left out"), whole, "{name}");
        let padded = |count: usize| {
            let mut filled = shape[..count].to_vec();
            filled.resize(10, 0.0);
            loaded(layout, &filled).unwrap().0
        };
        for count in [5, 8] {
            let part = format!("{count} values for a model of 10 directions; the others are zero");
            assert_eq!(said(count, &part), padded(count), "{name}");
        }
        assert_eq!(said(0, "no betas, for a model of 10 directions: the mean shape"), padded(0), "{name}");
        assert!((padded(0) - whole).abs() > 1e-3, "{name}: the shape counts");
    }
}
