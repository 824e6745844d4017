//! Avatars that somebody else made, in a table.

use crate::args;
use crate::program::{Answer, Desk};
use crate::support::data;
use serde_json::Value;
use skinsplat_core::scene::Binding;
use skinsplat_data::Subject;
use skinsplat_data::ply::{self, Encoding, Metadata};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A desk with `small.toml` and `anna.ply`, the surface avatar of the small subject, and its digest.
fn desk() -> (Desk, String) {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    run(&desk, "made", &["--variant", "surface"]).exits(0, "making an avatar");
    let avatars = std::fs::read_dir(desk.path("made/avatars")).unwrap().map(|entry| entry.unwrap().path());
    let made: Vec<PathBuf> = avatars.filter(|path| path.extension().is_some_and(|e| e == "ply")).collect();
    std::fs::copy(&made[0], desk.path("anna.ply")).unwrap();
    let digest = skinsplat_data::avatar::file_digest(&made[0]).unwrap();
    (desk, digest)
}

fn run(desk: &Desk, out: &str, more: &[&str]) -> Answer {
    let mut all =
        args!["-q", "run", "small.toml", "--data", data("small"), "--fit-iterations", "2", "--out", out];
    all.extend(more.iter().map(OsString::from));
    desk.run(all)
}

fn results(desk: &Desk, out: &str) -> Value {
    serde_json::from_str(&desk.read(&format!("{out}/results.json"))).unwrap()
}

/// PSNR of a variant of the first sequence.
fn psnr(results: &Value, variant: usize) -> f64 {
    results["tables"][0]["sequences"][0]["variants"][variant]["summary"]["values"]["psnr"].as_f64().unwrap()
}

/// A registry of the small subject with an avatar named `hers`, and an experiment whose second variant asks for it.
fn registered(desk: &Desk, path: &str, otherwise: &str) -> Vec<OsString> {
    let folder = data("small");
    desk.put(
        "datasets.toml",
        format!(
            "[[dataset]]\nid = \"tiny\"\ntitle = \"Small\"\nlayout = \"folder\"\ncapture = \"monocular\"\n\
             licence = \"CC0-1.0\"\nprovenance = \"here\"\npath = {:?}\nsubjects = [\"tiny\"]\n\
             [[dataset.avatars]]\nname = \"hers\"\npath = {path:?}\n",
            folder.display().to_string()
        ),
    );
    let fit = "recipe = \"fit\", name = \"hugs-skinned\"";
    let text =
        include_str!("small.toml").replace(fit, &format!("recipe = \"file\", name = \"hers\"{otherwise}"));
    desk.put("hers.toml", text.replace("\"small\"", "\"hers\""));
    let arguments = ["-q", "run", "hers.toml", "--datasets", "datasets.toml", "--fit-iterations", "2"];
    arguments.iter().map(OsString::from).chain(args!["--out", "run"]).collect()
}

#[test]
fn a_file_takes_the_place_of_an_avatar_and_the_caption_says_which() {
    let (desk, digest) = desk();
    let answer = run(&desk, "run", &["--avatar", "theirs=anna.ply"]).exits(0, "a file");
    let found = results(&desk, "run");
    assert_eq!(psnr(&found, 0), psnr(&found, 1), "the same avatar under the same strategy");
    let origin = format!("Avatar of Theirs: tiny: the file anna.ply (SHA-256 {})", &digest[..12]);
    assert!(answer.out.contains(&origin), "no `{origin}` in {}", answer.out);
    assert!(answer.out.contains("--avatar theirs=FILE"), "{}", answer.out);
    assert!(!desk.read("run/results.json").contains(&desk.path("").display().to_string()), "no paths");

    // Another place and name of the file, by subject, renders nothing anew.
    desk.put("elsewhere/tiny.ply", desk.bytes("anna.ply"));
    run(&desk, "run", &["--avatar", "theirs=elsewhere/{subject}.ply"]).exits(0, "moved");
    let provenance: Value = serde_json::from_str(&desk.read("run/run.json")).unwrap();
    assert_eq!(provenance["frames_rendered"], 0);
    assert!(desk.read("run/tables.md").contains("the file tiny.ply"));
}

#[test]
fn avatars_of_a_registry_come_by_name() {
    let (desk, digest) = desk();
    desk.put("avatars/tiny/point_cloud.ply", desk.bytes("anna.ply"));
    let page = desk.ok(registered(&desk, "avatars/{subject}/point_cloud.ply", ""));
    assert!(page.contains(&format!("tiny: the file point_cloud.ply (SHA-256 {})", &digest[..12])), "{page}");
    assert_eq!(psnr(&results(&desk, "run"), 0), psnr(&results(&desk, "run"), 1));
}

#[test]
fn a_file_that_is_missing_stops_the_run_before_it_begins_unless_a_fit_replaces_it() {
    let (desk, _) = desk();
    let arguments = registered(&desk, "avatars/{subject}.ply", "");
    let before = desk.contents();
    let parts =
        ["hers", "variants[1].avatar", "variant theirs", "tiny/tiny", "avatars/tiny.ply", "otherwise"];
    desk.run(arguments).refuses(&parts, "no file");
    assert!(desk.contents() == before, "nothing was begun");
    run(&desk, "run", &["--avatar", "theirs=nothing.ply"])
        .refuses(&["variant theirs", "tiny/tiny", "nothing.ply"], "an argument");
    run(&desk, "run", &["--avatar", "nobody=anna.ply"])
        .refuses(&["--avatar nobody=anna.ply", "expected one of surface, theirs"], "no such variant");
    run(&desk, "run", &["--avatar", "anna.ply"]).refuses(&["VARIANT=FILE"], "no variant");
    assert!(desk.contents() == before, "nothing was begun");

    let fitting = registered(&desk, "avatars/{subject}.ply", ", otherwise = \"hugs-skinned\"");
    let page = desk.ok(fitting);
    assert!(page.contains("Avatar of Theirs: tiny: no file, so fitted by hugs-skinned"), "{page}");
}

#[test]
fn a_file_that_does_not_fit_the_body_is_named() {
    let (desk, _) = desk();
    let mut avatar = ply::read_avatar(&desk.path("anna.ply")).unwrap();
    avatar.binding = Binding::Face(skinsplat_core::scene::FaceBinding {
        faces: vec![4_000; avatar.gaussians.len()],
        barycentric: vec![[1.0, 0.0, 0.0]; avatar.gaussians.len()],
        offsets: vec![0.0; avatar.gaussians.len()],
    });
    write(&desk.path("big.ply"), &avatar);
    run(&desk, "run", &["--avatar", "theirs=big.ply"]).refuses(
        &["variant theirs", "big.ply: face[0]: face 4000; expected an index below the body's"],
        "faces",
    );
    desk.put("broken.ply", b"ply\n");
    run(&desk, "run", &["--avatar", "theirs=broken.ply"]).refuses(&["broken.ply", "header"], "not an avatar");
    desk.put("folder/readme.txt", "x");
    run(&desk, "run", &["--avatar", "theirs=folder"]).refuses(&["folder", "point_cloud.ply"], "a folder");
    assert!(!desk.path("run").exists(), "nothing was begun");
}

fn write(path: &Path, avatar: &skinsplat_core::scene::Avatar) {
    ply::write_avatar(path, avatar, &Metadata::default(), Encoding::LittleEndian).unwrap();
}

/// Gaussians on the surface take the weights of the surface: a plain 3DGS file scores nearly as the bound one.
#[test]
fn a_file_without_a_binding_takes_the_weights_of_the_surface() {
    let (desk, _) = desk();
    let mut avatar = ply::read_avatar(&desk.path("anna.ply")).unwrap();
    avatar.binding = Binding::Static;
    write(&desk.path("plain.ply"), &avatar);
    let page = run(&desk, "run", &["--avatar", "theirs=plain.ply"]).exits(0, "unbound").out;
    assert!(page.contains("skinning weights of the nearest points of the body's surface"), "{page}");
    let found = results(&desk, "run");
    assert!((psnr(&found, 0) - psnr(&found, 1)).abs() < 0.5, "{} {}", psnr(&found, 0), psnr(&found, 1));
}

/// An export of SplattingAvatar, canonical on the body turned by 90 degrees: `point_cloud.ply`, `embedding.json`,
/// `embedding.obj`.
fn export(folder: &Path, gaussians: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let body = Subject::load(&data("small/tiny"), &Default::default()).unwrap().train.remove(0).body;
    let mut avatar = ply::read_avatar(gaussians).unwrap();
    avatar.binding = Binding::Static;
    write(&folder.join("point_cloud.ply"), &avatar);
    let turned = body.vertices.iter().map(|v| format!("v {} {} {}\n", -v.y, v.x, v.z)).collect::<String>();
    let faces =
        body.faces.iter().map(|f| format!("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1)).collect::<String>();
    std::fs::write(folder.join("embedding.obj"), turned + &faces).unwrap();
    let n = avatar.gaussians.len();
    let half = 0.5_f32.sqrt();
    let embedding = serde_json::json!({
        "cano_mesh": "embedding.obj",
        "sample_fidxs": (0..n).map(|i| i % body.faces.len()).collect::<Vec<_>>(),
        "sample_bary": vec![[0.25, 0.25, 0.5]; n],
        "_xyz": vec![[0.0, 0.0, 0.001]; n],
        "_rotation": vec![[half, 0.0, 0.0, half]; n],
    });
    std::fs::write(folder.join("embedding.json"), embedding.to_string()).unwrap();
}

#[test]
fn exports_of_splatting_avatar_are_recognised() {
    let (desk, _) = desk();
    export(&desk.path("export"), &desk.path("anna.ply"));
    let page = run(&desk, "run", &["--avatar", "theirs=export"]).exits(0, "the folder").out;
    assert!(page.contains("the file export (SHA-256 ") && page.contains("SplattingAvatar"), "{page}");
    let folder = results(&desk, "run");
    run(&desk, "again", &["--avatar", "theirs=export/point_cloud.ply"]).exits(0, "the file");
    assert_eq!(psnr(&folder, 1), psnr(&results(&desk, "again"), 1));
    for path in ["export", "export/point_cloud.ply"] {
        assert!(desk.ok(args!["inspect", path]).contains("SplattingAvatar export"), "{path}");
    }
    // What is canonical on a turned mesh is carried back: the turn of 90 degrees about z is gone at rest.
    let body = Subject::load(&data("small/tiny"), &Default::default()).unwrap().train.remove(0).body;
    let loaded = skinsplat_data::avatar::read_avatar(&desk.path("export")).unwrap();
    let skinsplat::run::foreign::OnBody { avatar, notes, .. } =
        skinsplat::run::foreign::on_body(loaded, &body).unwrap();
    assert_eq!(notes.len(), 1);
    for rotation in &avatar.gaussians.rotations {
        assert!(rotation[0].abs() > 1.0 - 1e-5, "{rotation:?}");
    }
    // One of its files changes: so does the key.
    let key = |out: &str| {
        results(&desk, out)["tables"][0]["sequences"][0]["variants"][1]["frames"][0]["key"].clone()
    };
    let mesh = desk.read("export/embedding.obj");
    desk.put("export/embedding.obj", mesh + "# remark\n");
    run(&desk, "again", &["--avatar", "theirs=export"]).exits(0, "another mesh");
    assert_ne!(key("run"), key("again"));
}
