//! The layers of ARCHITECTURE.md, checked against the imports of every source file.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use std::path::{Path, PathBuf};

/// Module, layer, and same-layer modules that it may import all the same.
const LAYERS: [(&str, u8, &[&str]); 13] = [
    ("math", 0, &[]),
    ("scene", 1, &[]),
    ("strategy", 2, &[]),
    ("render", 2, &[]),
    ("metrics", 2, &[]),
    ("data", 3, &[]),
    ("experiment", 4, &[]),
    ("fit", 5, &[]),
    ("run", 5, &["fit"]),
    ("report", 5, &["run"]),
    ("trade", 5, &["run", "fit", "report"]),
    ("stress", 5, &[]),
    ("cli", 6, &[]),
];

/// Crates that belong to one place: everything else stays free of them.
const HOMES: [(&str, &[&str]); 6] = [
    ("clap::", &["src/cli"]),
    ("indicatif::", &["src/cli"]),
    ("anyhow::", &["src/cli"]),
    ("gltf::", &["src/data"]),
    ("npyz::", &["src/data"]),
    ("plotters::", &["src/report/plot"]),
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
    let layer = |name: &str| LAYERS.iter().find(|(module, ..)| *module == name);
    let mut edges = 0;
    for (file, text) in all_sources() {
        let Some(module) = file.strip_prefix("src/").and_then(|f| f.split(['/', '.']).next()) else {
            continue;
        };
        let Some((_, own, friends)) = layer(module) else {
            assert!(["lib", "main"].contains(&module), "{file}: not in the table of layers");
            continue;
        };
        for import in imported(&code(&text)) {
            let Some((_, other, _)) = layer(import) else { continue };
            let allowed = import == module || other < own || friends.contains(&import);
            assert!(allowed, "{file} (layer {own}) imports {import} (layer {other})");
            edges += usize::from(import != module);
        }
    }
    assert!(edges > 20, "only {edges} imports found: the scan is broken");
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
