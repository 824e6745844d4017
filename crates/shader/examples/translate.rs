//! Writes `translations/` anew: `cargo run -p skinsplat-shader --features translate --example translate`.

use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("translations");
    for file in skinsplat_shader::translate::translations()? {
        let path = folder.join(&file.path);
        std::fs::create_dir_all(path.parent().unwrap_or(&folder))?;
        std::fs::write(&path, &file.bytes)?;
    }
    Ok(())
}
