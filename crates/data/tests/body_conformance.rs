//! Posed bodies against the expected vertices that come with the data: `gt_lbs_check.npz` of each sequence (SMPL-style
//! models) and `*_check.npz` of each glTF model. `SKINSPLAT_DATA=DIR` checks a further folder of the same layout.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "../../../tests/support/mod.rs"]
mod support;

use glam::DVec3;
use skinsplat_core::scene::PosedBody;
use skinsplat_data::{Subject, folder, gltf::Rig, npz::Archive};
use std::path::{Path, PathBuf};

/// Metres. The expected vertices are f64 or f32 values of bodies of 2 m, which f32 holds to 1.2e-7.
const SMPL_TOLERANCE: f64 = 1e-6;
/// Metres; Blender's importer, which made these, works in f32 throughout.
const GLTF_TOLERANCE: f64 = 1e-5;

fn points(archive: &mut Archive, name: &str, pattern: &str) -> Vec<DVec3> {
    archive.require(name, pattern).unwrap().values.chunks_exact(3).map(DVec3::from_slice).collect()
}

fn indices(archive: &mut Archive, name: &str) -> Vec<usize> {
    archive.require(name, "*").unwrap().values.iter().map(|&v| v as usize).collect()
}

fn max_distance(found: impl Iterator<Item = DVec3>, expected: &[DVec3]) -> f64 {
    found.zip(expected).map(|(a, b)| (a - *b).length()).fold(0.0, f64::max)
}

/// Largest distance over all sequences of a folder of subjects, and the number of vertices compared.
fn check_subjects(root: &Path) -> (f64, usize) {
    let mut worst = (0.0f64, 0);
    for subject in subfolders(&root.join("datasets")) {
        let loaded = Subject::load(&subject, &folder::Options::default()).unwrap();
        for sequence in loaded.sequences() {
            let path = subject.join(&sequence.id).join("gt_lbs_check.npz");
            let mut check = Archive::open(&path, "check").unwrap();
            let frames = indices(&mut check, "frames");
            let ids = indices(&mut check, "vertex_ids");
            let vertices = points(&mut check, "vertices", "F,N,3");
            let joints = points(&mut check, "joints", "F,J,3");
            assert!(!frames.is_empty() && !ids.is_empty());
            let num_joints = joints.len() / frames.len();
            for (k, &frame) in frames.iter().enumerate() {
                let pose = &sequence.poses[frame];
                let posed = PosedBody::new(&sequence.body, pose).unwrap();
                let mesh = posed.mesh();
                let found = ids.iter().map(|&i| mesh.vertices[i].as_dvec3());
                let error = max_distance(found, &vertices[k * ids.len()..]);
                let world = sequence.body.skeleton.world_transforms(&pose.locals);
                let found = world.iter().map(|t| t.translation + pose.translation);
                let joint_error = max_distance(found, &joints[k * num_joints..(k + 1) * num_joints]);
                assert!(error <= SMPL_TOLERANCE, "{} frame {frame}: {error} m", path.display());
                assert!(
                    joint_error <= SMPL_TOLERANCE,
                    "{} frame {frame}: joints {joint_error} m",
                    path.display()
                );
                worst = (worst.0.max(error), worst.1 + ids.len());
            }
        }
    }
    worst
}

/// Largest distance over all keys of all clips of all glTF models, and the number of vertices compared.
fn check_rigs(root: &Path) -> (f64, usize) {
    let mut worst = (0.0f64, 0);
    for model in files(&root.join("models"), "glb") {
        let rig = Rig::load(&model).unwrap();
        let path = model.with_file_name(format!("{}_check.npz", model.file_stem().unwrap().display()));
        let mut check = Archive::open(&path, "check").unwrap();
        assert!(!rig.clips.is_empty());
        for clip in &rig.clips {
            let keys = indices(&mut check, &format!("{}_key", clip.name));
            let times = check.require(&format!("{}_time", clip.name), "*").unwrap().values;
            let vertices = points(&mut check, &format!("{}_vertices", clip.name), "*,V,3");
            let poses = clip.key_poses(&rig).unwrap();
            assert!(!keys.is_empty());
            for (k, (&key, &time)) in keys.iter().zip(&times).enumerate() {
                assert_eq!(clip.key_times()[key], time);
                let posed = PosedBody::new(&rig.body.rest, &poses[key]).unwrap();
                let count = rig.body.rest.vertices.len();
                let found = posed.mesh().vertices.iter().map(|v| v.as_dvec3());
                let error = max_distance(found, &vertices[k * count..(k + 1) * count]);
                assert!(error <= GLTF_TOLERANCE, "{} {} key {key}: {error} m", model.display(), clip.name);
                worst = (worst.0.max(error), worst.1 + count);
            }
        }
    }
    worst
}

fn subfolders(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .collect();
    found.sort();
    found
}

fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    found.sort();
    found
}

#[test]
fn smpl_style_bodies_reproduce_the_expected_vertices() {
    let (error, compared) = check_subjects(&support::data("blender"));
    println!("{compared} vertices, largest error {error:.3e} m");
    assert_eq!(compared, 22 * 100, "every check of the committed subset");
}

#[test]
fn gltf_rigs_reproduce_the_expected_vertices() {
    let (error, compared) = check_rigs(&support::data("blender"));
    println!("{compared} vertices, largest error {error:.3e} m");
    assert!(compared > 5 * 4 * 300, "every clip of the three rigs");
}

#[test]
fn a_folder_named_by_the_environment_conforms_too() {
    let Some(root) = std::env::var_os("SKINSPLAT_DATA").map(PathBuf::from) else { return };
    let (smpl, rigs) = (check_subjects(&root), check_rigs(&root));
    println!("{}: SMPL {smpl:?}, glTF {rigs:?} (metres, vertices)", root.display());
}
