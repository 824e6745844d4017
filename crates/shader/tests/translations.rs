//! `translations/` is what naga makes of the source, and passes the validators that are installed.
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(clippy::print_stdout, reason = "says what was skipped")]

use skinsplat_shader::translate::translations;
use std::path::{Path, PathBuf};
use std::process::Command;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("translations")
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn committed_files_are_current() {
    let made = translations().unwrap();
    for file in &made {
        let there = std::fs::read(folder().join(&file.path)).unwrap_or_default();
        assert!(
            there == file.bytes,
            "translations/{} is stale: cargo run -p skinsplat-shader --features translate --example translate",
            file.path
        );
    }
    assert_eq!(files(&folder()).len(), made.len(), "files that nothing makes");
}

/// Runs a validator on a file; says so where there is none.
fn validate(program: &str, arguments: &[&str], file: &Path) -> bool {
    match Command::new(program).args(arguments).arg(file).output() {
        Err(_) => {
            println!("skipped: no {program}");
            false
        }
        Ok(output) => {
            let said = [output.stdout, output.stderr].concat();
            let said = String::from_utf8_lossy(&said);
            assert!(output.status.success(), "{program} {}: {said}", file.display());
            true
        }
    }
}

#[test]
fn validators_accept_them() {
    validate("spirv-val", &["--target-env", "vulkan1.1"], &folder().join("skinning.spv"));
    for file in files(&folder().join("glsl")) {
        if !validate("glslangValidator", &["-S", "comp"], &file) {
            break;
        }
    }
    // HLSL as far as glslang reads it: to SPIR-V, one entry point after the other.
    for name in skinsplat_shader::entry_points() {
        let out = std::env::temp_dir().join(format!("skinsplat-shader-{}-{name}.spv", std::process::id()));
        let arguments =
            ["-D", "-V", "-S", "comp", "-e", &name, "--auto-map-bindings", "-o", out.to_str().unwrap()];
        let ran = validate("glslangValidator", &arguments, &folder().join("skinning.hlsl"));
        let _ = std::fs::remove_file(&out);
        if !ran {
            break;
        }
    }
}
