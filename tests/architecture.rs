//! What the compiler cannot guard: the order of the harness's modules, the arrows between crates, and which place may use
//! which library. ARCHITECTURE.md draws them.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use std::path::{Path, PathBuf};

/// Modules of the harness, lowest first: one imports only from those before it.
const MODULES: [&str; 6] = ["toml_problem", "quoting", "datasets", "experiment", "run", "report"];

/// The crates, and what each may be built on. Tests and examples may use more.
const CRATES: [(&str, &[&str]); 18] = [
    ("core", &[]),
    ("simd", &[]),
    ("table", &[]),
    ("plot", &[]),
    ("page", &["table"]),
    ("lpips-alex", &[]),
    ("posing", &["core", "simd"]),
    ("render", &["core", "simd"]),
    ("metrics", &["core", "simd", "lpips-alex"]),
    ("data", &["core"]),
    ("statistics", &["core"]),
    ("conform", &["core", "data"]),
    ("shader", &["core"]),
    ("view", &["core", "shader"]),
    ("synthetic", &["core", "data", "render"]),
    ("check", &["core", "data", "render"]),
    ("fit", &["core", "simd", "data", "posing", "render"]),
    (
        "study",
        &["core", "simd", "data", "fit", "metrics", "page", "plot", "posing", "render", "synthetic", "table"],
    ),
];

/// Libraries that belong to one place: everything else stays free of them.
const HOMES: [(&str, &[&str]); 16] = [
    ("signal_hook::", &["src/cli/interrupt.rs"]),
    ("clap::", &["src/cli", "crates/shader/src/bin"]),
    ("indicatif::", &["src/cli"]),
    ("anyhow::", &["src/cli"]),
    ("gltf::", &["crates/data"]),
    ("zune_jpeg::", &["crates/data"]),
    ("hdf5_pure::", &["crates/data/src/hdf5.rs"]),
    ("tiff::", &["crates/data/src/depth.rs"]),
    ("zip::", &["crates/data"]),
    ("half::", &["crates/data", "crates/study", "crates/view"]),
    ("plotters::", &["crates/plot"]),
    ("maud::", &["crates/page"]),
    ("gif::", &["src/run/pictures.rs"]),
    ("quick_junit::", &["src/report"]),
    ("wgpu::", &["crates/shader/src/gpu"]),
    ("naga::", &["crates/shader/src/translate.rs"]),
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

fn all_sources() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&root.join("src"), &mut files);
    for (name, _) in CRATES {
        sources(&root.join("crates").join(name).join("src"), &mut files);
    }
    let name = |f: &PathBuf| f.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
    files.iter().map(|f| (name(f), std::fs::read_to_string(f).unwrap())).collect()
}

/// The part of a source that is code: comments out, so that prose and links may name any module.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Top-level modules named after `crate::`, also inside a braced import `crate::{a::B, c}`.
fn imported(code: &str) -> Vec<&str> {
    let mut modules = Vec::new();
    for part in code.split("crate::").skip(1) {
        let word = |s: &'_ str| s.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(s.len());
        match part.strip_prefix('{') {
            None => modules.push(&part[..word(part)]),
            Some(list) => {
                let mut depth = 0;
                let mut start = true;
                for (i, c) in list.char_indices() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => start = true,
                        c if start && c.is_alphanumeric() => {
                            start = false;
                            modules.push(&list[i..i + word(&list[i..])]);
                        }
                        _ => {}
                    }
                }
            }
        }
    }
    modules
}

#[test]
fn no_module_imports_upwards() {
    let layer = |name: &str| MODULES.iter().position(|module| *module == name);
    let mut edges = 0;
    for (file, text) in all_sources() {
        let Some(module) = file.strip_prefix("src/").and_then(|f| f.split(['/', '.']).next()) else {
            continue;
        };
        let Some(own) = layer(module) else {
            assert!(["lib", "main", "cli"].contains(&module), "{file}: not in the list of modules");
            continue;
        };
        for import in imported(&code(&text)) {
            let Some(other) = layer(import) else { continue };
            assert!(other <= own, "{file} imports {import}, which is above {module}");
            edges += usize::from(other < own);
        }
    }
    assert!(edges > 20, "only {edges} imports found: the scan is broken");
}

/// The crates of the workspace that a manifest names among its dependencies.
fn built_on(manifest: &str) -> Vec<String> {
    let manifest: toml::Table = manifest.parse().unwrap();
    let names = manifest["dependencies"].as_table().map(|table| table.keys().cloned().collect::<Vec<_>>());
    names
        .unwrap_or_default()
        .iter()
        .filter_map(|name| Some(name.strip_prefix("skinsplat-")?.to_owned()))
        .collect()
}

#[test]
fn crates_are_built_on_those_below_them() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    let mut found: Vec<String> = (std::fs::read_dir(&folder).unwrap())
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    found.sort();
    let mut known: Vec<&str> = CRATES.iter().map(|(name, _)| *name).collect();
    known.sort_unstable();
    assert_eq!(found, known, "the folders of crates/ and the list above");
    for (name, allowed) in CRATES {
        let manifest = std::fs::read_to_string(folder.join(name).join("Cargo.toml")).unwrap();
        if !manifest.contains("[dependencies]") {
            continue;
        }
        for other in built_on(&manifest) {
            assert!(allowed.contains(&other.as_str()), "{name} is built on {other}");
        }
    }
}

#[test]
fn crates_stay_where_they_belong() {
    for (file, text) in all_sources() {
        let code = code(&text);
        for (krate, homes) in HOMES {
            let own = code.contains(&format!(" {krate}")) || code.contains(&format!("({krate}"));
            assert!(
                !own || homes.iter().any(|h| file.starts_with(h)),
                "{file} uses {krate} outside {homes:?}"
            );
        }
    }
}

#[test]
fn the_scan_reads_braced_imports() {
    let text = "use crate::{math::{sh, average}, scene::Camera};\nlet x = crate::render::draw();";
    assert_eq!(imported(text), ["math", "scene", "render"]);
}

/// Whoever opens a file by another way waits for pipes and reads devices to no end.
#[test]
fn files_are_opened_in_one_place() {
    for (file, text) in all_sources() {
        if file == "crates/data/src/source.rs" || file.contains("fixture") {
            continue;
        }
        let code = code(text.split("#[cfg(test)]").next().unwrap());
        for call in ["File::open(", "fs::read(", "fs::read_to_string(", "image::open("] {
            assert!(!code.contains(call), "{file}: {call}; expected skinsplat_data::source");
        }
    }
}

/// The Python package compiles the command line into itself, apart from what the tests build: its manifest has to name whatever
/// `src/cli` uses.
#[test]
fn the_python_package_has_every_library_of_the_command_line() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let names = |manifest: &str| -> Vec<String> {
        let text = std::fs::read_to_string(root.join(manifest)).unwrap();
        let table: toml::Table = text.parse().unwrap();
        table["dependencies"].as_table().unwrap().keys().cloned().collect()
    };
    let mut files = Vec::new();
    sources(&root.join("src/cli"), &mut files);
    let text: String = files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    let python = names("python/Cargo.toml");
    let used = names("Cargo.toml").into_iter().filter(|name| {
        let path = format!("{}::", name.replace('-', "_"));
        text.match_indices(&path)
            .any(|(at, _)| !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_'))
    });
    let missing: Vec<String> = used.filter(|name| !python.contains(name)).collect();
    assert!(missing.is_empty(), "python/Cargo.toml: no {missing:?}");
}
