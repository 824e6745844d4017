//! Names, numbers and counts: which file, row and mask belong together.

use super::support;
use super::{SPLIT, load, model, place};
use skinsplat_data::layouts::Split;
use skinsplat_data::{Error, FrameFiles, FrameSource, Subject};
use std::path::Path;

/// Copies a folder and all that is in it.
pub(crate) fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target)
        } else {
            std::fs::copy(entry.path(), target).map(drop).unwrap();
        }
    }
}

fn ava(folder: &Path, split: Option<&Split>) -> Result<Subject, Error> {
    load("peoplesnapshot", folder, model("anny_smpl24.npz"), split)
}

/// Image, mask and row of poses of every frame for training.
fn triples(subject: &Subject) -> Vec<(String, String, usize)> {
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    let triple = |frame: &skinsplat_data::FrameRef| match &frame.source {
        FrameSource::Files(FrameFiles { image, mask: Some(mask), .. }) => {
            (name(image), name(&mask.path), frame.pose)
        }
        other => panic!("{other:?}"),
    };
    subject.train[0].frames.iter().map(triple).collect()
}

#[test]
fn unpadded_and_hidden_names_shift_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let subject = folder.path().join("female-9");
    copy(&place("peoplesnapshot/ava"), &subject);
    std::fs::remove_file(subject.join("config.json")).unwrap();
    // Eight frames become fifteen by repetition, with names as ffmpeg's %d writes them.
    for i in (0..15).rev() {
        let from = i % 8;
        for (kind, end) in [("image", "png"), ("mask", "npy")] {
            let stored = place(&format!("peoplesnapshot/ava/{kind}s/{kind}_{from:04}.{end}"));
            std::fs::copy(stored, subject.join(format!("{kind}s/{kind}_{i}.{end}"))).unwrap();
            let _ = std::fs::remove_file(subject.join(format!("{kind}s/{kind}_{i:04}.{end}")));
            std::fs::write(subject.join(format!("{kind}s/._{kind}_{i}.{end}")), b"Mac OS X").unwrap();
        }
    }
    let split = Split { train: [2, 14, 4], test: [0, 7, 7] };
    let error = ava(&subject, Some(&split)).unwrap_err();
    // The refined test poses are two; those of the video are eight.
    assert!(error.to_string().contains("poses.npz: poses: 8 of them; expected 15"), "{error}");
    let thetas: Vec<f32> = (0..15 * 72).map(|i| i as f32 / 2000.0).collect();
    support_npz(&subject.join("poses.npz"), 15, thetas);
    let loaded = ava(&subject, Some(&split)).unwrap();
    let expected: Vec<_> =
        [2, 6, 10, 14].map(|i| (format!("image_{i}.png"), format!("mask_{i}.npy"), i)).into_iter().collect();
    assert_eq!(triples(&loaded), expected);
    std::fs::remove_file(subject.join("masks/mask_6.npy")).unwrap();
    let error = ava(&subject, Some(&split)).unwrap_err();
    assert!(error.to_string().contains("masks: frame 6 is missing"), "{error}");
    // A hidden file is no mask either.
    std::fs::remove_file(subject.join("images/image_6.png")).unwrap();
    let error = ava(&subject, Some(&split)).unwrap_err();
    assert!(error.to_string().contains("images: frame 6 is missing"), "{error}");
}

fn support_npz(path: &Path, frames: usize, thetas: Vec<f32>) {
    let mut archive = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    let mut put = |name: &str, shape: &str, values: &[f32]| {
        use std::io::Write;
        let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
        let header = format!("{dict:<117}\n");
        archive.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(b"\x93NUMPY\x01\x00").unwrap();
        archive.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
        archive.write_all(header.as_bytes()).unwrap();
        values.iter().for_each(|v| archive.write_all(&v.to_le_bytes()).unwrap());
    };
    put("thetas", &format!("{frames}, 72"), &thetas);
    put("transl", &format!("{frames}, 3"), &vec![0.0; frames * 3]);
    put("betas", "10,", &[0.0; 10]);
    archive.finish().unwrap();
}

#[test]
fn splattingavatars_files_bring_gender_and_ranges() {
    let folder = tempfile::tempdir().unwrap();
    let subject = folder.path().join("whoever");
    copy(&place("peoplesnapshot/ava"), &subject);
    let loaded = ava(&subject, None).unwrap();
    assert_eq!((loaded.train[0].frames.len(), loaded.test[0].frames.len()), (6, 2));
    // A registry's split counts more. Refined poses of config.json's range serve every second of its frames.
    let split = Split { train: [1, 5, 2], test: [7, 7, 1] };
    let loaded = ava(&subject, Some(&split)).unwrap();
    let rows: Vec<usize> = loaded.sequences().flat_map(|s| s.frames.iter().map(|f| f.pose)).collect();
    assert_eq!(rows, [1, 3, 5, 1]);
    // Masks as PNG, 0 to 255; a gender that nobody knows.
    std::fs::remove_dir_all(subject.join("masks")).unwrap();
    copy(&place("neuman/ava/4d_humans/sam_segmentations"), &subject.join("masks"));
    let png = ava(&subject, None).unwrap().test[0].truth(0).unwrap();
    assert_eq!(png.alpha, loaded_truth());
    let config = std::fs::read_to_string(subject.join("config.json")).unwrap();
    std::fs::write(subject.join("config.json"), config.replace("neutral", "robot")).unwrap();
    let error = ava(&subject, None).unwrap_err().to_string();
    assert!(error.contains("config.json: gender: \"robot\"; expected female, male or neutral"), "{error}");
    std::fs::remove_file(subject.join("config.json")).unwrap();
    let error = ava(&subject, None).unwrap_err().to_string();
    assert!(error.contains("splits.whoever: missing"), "{error}");
}

fn loaded_truth() -> skinsplat_core::scene::Mask {
    ava(&place("peoplesnapshot/ava"), None).unwrap().test[0].truth(0).unwrap().alpha
}

#[test]
fn the_four_subjects_bring_their_splits() {
    let folder = tempfile::tempdir().unwrap();
    let subject = folder.path().join("male-3-casual");
    copy(&place("peoplesnapshot/ava"), &subject);
    std::fs::remove_file(subject.join("config.json")).unwrap();
    let error = ava(&subject, None).unwrap_err().to_string();
    assert!(
        error.contains("split.train: [0, 455, 4]; expected [first, last, step] within the 8 images"),
        "{error}"
    );
    // And their gender: the model is looked for by it.
    let error = load("peoplesnapshot", &subject, None, Some(&SPLIT)).unwrap_err().to_string();
    assert!(error.contains("no male body; expected SMPL_MALE.npz"), "{error}");
}

#[test]
fn poses_by_hugs_are_scaled_before_they_are_moved() {
    let folder = tempfile::tempdir().unwrap();
    copy(&place("neuman/ava"), folder.path());
    let whole = load("neuman", folder.path(), model("anny_smpl24.npz"), Some(&SPLIT)).unwrap();
    let path = folder.path().join("4d_humans/smpl_optimized_aligned_scale.npz");
    let scaled = support::data("small/layouts/neuman/scaled.npz");
    std::fs::copy(scaled, path).unwrap();
    let larger = load("neuman", folder.path(), model("anny_smpl24.npz"), Some(&SPLIT)).unwrap();
    let (a, b) = (&whole.train[0], &larger.train[0]);
    for frame in 0..a.frames.len() {
        let scale = 1.0 + 0.125 * a.frames[frame].time as f64;
        let shift = a.poses[a.frames[frame].pose].translation;
        for (x, y) in super::posed(a, frame).iter().zip(&super::posed(b, frame)).step_by(499) {
            let expected = (*x - shift) * scale + shift;
            assert!((expected - *y).length() < 1e-5, "frame {frame}: {y} instead of {expected}");
        }
    }
}
