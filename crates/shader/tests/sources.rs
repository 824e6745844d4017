//! The committed files, without a translator: the translations are of this source, and hold every entry point.

use sha2::{Digest, Sha256};
use skinsplat_shader::{SKINNING, VIEW, entry_points};
use std::path::Path;

fn translation(path: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("translations").join(path);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn translations_are_of_this_source() {
    let digest: String =
        Sha256::digest([SKINNING, VIEW].concat()).iter().map(|byte| format!("{byte:02x}")).collect();
    let noted = String::from_utf8(translation("SOURCE.sha256")).unwrap();
    assert_eq!(
        noted.split_whitespace().next(),
        Some(digest.as_str()),
        "translations/ is stale: cargo run -p skinsplat-shader --features translate --example translate"
    );
}

#[test]
fn every_entry_point_is_in_every_language() {
    let (hlsl, metal, spirv) =
        (translation("skinning.hlsl"), translation("skinning.metal"), translation("skinning.spv"));
    let holds = |bytes: &[u8], name: &str| bytes.windows(name.len()).any(|part| part == name.as_bytes());
    assert_eq!(entry_points().len(), 12);
    for name in entry_points() {
        assert!(SKINNING.contains(&format!("fn {name}(@builtin")), "{name} in WGSL");
        assert!(holds(&hlsl, &format!("void {name}(")), "{name} in HLSL");
        assert!(holds(&metal, &format!("kernel void {name}(")), "{name} in MSL");
        assert!(holds(&spirv, &name), "{name} in SPIR-V");
        assert!(holds(&translation(&format!("glsl/{name}.comp")), "void main()"), "{name} in GLSL");
    }
}
