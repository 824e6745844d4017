//! An engine that forgets to turn SH, and what is said of it.
//!
//! `cargo run -p skinsplat-conform --example an_engine_with_a_bug`
#![expect(clippy::print_stdout, reason = "an example")]

use serde_json::Value;
use skinsplat_conform::{Cases, Convention, Options, check, export};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::temp_dir().join(format!("skinsplat-engine-{}", std::process::id()));
    export(&folder, Cases::Small, &Convention::default())?;
    // A real engine would skin `avatar.ply`; this one copies the right answer, but for the SH, which stay canonical.
    let mut answer: Value = serde_json::from_slice(&std::fs::read(folder.join("vectors.json"))?)?;
    let canonical = answer["inputs"]["canonical_sh"].clone();
    if let Some(poses) = answer["sh"].as_array_mut() {
        poses.fill(canonical);
    }
    let file = folder.join("answer.json");
    std::fs::write(&file, answer.to_string())?;
    print!("{}", check(&folder, &file, &Options::default())?.text());
    std::fs::remove_dir_all(&folder)?;
    Ok(())
}
