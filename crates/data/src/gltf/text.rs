//! The JSON of a glTF document, before the `gltf` crate sees it: what that crate would refuse in words about something else.

use ::gltf::json::Root;
use serde_json::Value;
use skinsplat_core::scene::SceneError;
use std::borrow::Cow;

/// Ways to compress geometry, which are not read. A file may hold the plain data too and not require them.
const COMPRESSED: [(&str, &str); 3] = [
    ("KHR_draco_mesh_compression", "Draco"),
    ("EXT_meshopt_compression", "meshopt"),
    ("KHR_meshopt_compression", "meshopt"),
];

/// Extensions that change nothing about where vertices are.
const HARMLESS: [&str; 4] =
    ["KHR_mesh_quantization", "KHR_texture_transform", "KHR_animation_pointer", "KHR_gaussian_splatting"];
const HARMLESS_PREFIXES: [&str; 5] =
    ["KHR_materials_", "KHR_lights_", "KHR_texture_", "EXT_texture_", "VRMC_"];

/// The JSON text of a file and, in a `.glb`, its binary chunk.
pub(super) type Chunks<'a> = (Cow<'a, [u8]>, Option<Vec<u8>>);

/// The JSON text and the binary chunk of a `.glb` or `.gltf` file.
pub(super) fn split(bytes: &[u8]) -> Result<Chunks<'_>, ::gltf::Error> {
    if !bytes.starts_with(b"glTF") {
        return Ok((Cow::Borrowed(bytes), None));
    }
    // The crate subtracts its header's 12 bytes from the stated length unseen.
    let stated = bytes.get(8..12).and_then(|field| Some(u32::from_le_bytes(field.try_into().ok()?)));
    if let Some(length @ ..12) = stated {
        let length_read = bytes.len();
        return Err(::gltf::Error::Binary(::gltf::binary::Error::Length { length, length_read }));
    }
    let glb = ::gltf::binary::Glb::from_slice(bytes)?;
    Ok((glb.json, glb.bin.map(Cow::into_owned)))
}

/// The document, without animation channels that have no node: glTF 2.0 asks to ignore them.
pub(super) fn parse(text: &[u8]) -> Result<Root, SceneError> {
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    let broken = |e: serde_json::Error| SceneError::new("glTF", e.to_string(), "a glTF 2.0 document");
    let mut value: Value = serde_json::from_slice(text).map_err(broken)?;
    let dropped = drop_channels_without_node(&mut value);
    let renamed = rename_splat_attributes(&mut value);
    let text = match dropped || renamed {
        true => Cow::Owned(serde_json::to_vec(&value).map_err(broken)?),
        false => Cow::Borrowed(text),
    };
    serde_json::from_slice(&text).map_err(broken)
}

/// True if there were any.
fn drop_channels_without_node(document: &mut Value) -> bool {
    let mut dropped = false;
    let animations = document.get_mut("animations").and_then(Value::as_array_mut);
    for animation in animations.into_iter().flatten() {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        let before = channels.len();
        channels.retain(|channel| channel.get("target").is_none_or(|target| target.get("node").is_some()));
        dropped |= channels.len() < before;
    }
    dropped
}

/// Gives the attributes of KHR_gaussian_splatting the underscore that the `gltf` crate asks of names that it does not know, and
/// puts the extension's object where it keeps it (`extras`). True if there are any.
fn rename_splat_attributes(document: &mut Value) -> bool {
    const EXTENSION: &str = "KHR_gaussian_splatting";
    let mut renamed = false;
    let meshes = document.get_mut("meshes").and_then(Value::as_array_mut).into_iter().flatten();
    let primitives = meshes.filter_map(|mesh| mesh.get_mut("primitives")?.as_array_mut()).flatten();
    for primitive in primitives {
        let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) else {
            continue;
        };
        let own = |name: &String| name.strip_prefix(EXTENSION).is_some_and(|rest| rest.starts_with(':'));
        let names: Vec<String> = attributes.keys().filter(|name| own(name)).cloned().collect();
        for name in &names {
            if let Some(accessor) = attributes.remove(name) {
                attributes.insert(format!("_{name}"), accessor);
            }
        }
        if names.is_empty() {
            continue;
        }
        renamed = true;
        let object = primitive.get("extensions").and_then(|all| all.get(EXTENSION)).cloned();
        if let (Some(object), Some(primitive)) = (object, primitive.as_object_mut()) {
            primitive.insert("extras".to_owned(), serde_json::json!({ EXTENSION: object }));
        }
    }
    renamed
}

/// Takes the list of required extensions out of the document, which the `gltf` crate would check against its own, and says
/// which of them are not known. Returns the list and the notes.
///
/// # Errors
/// Geometry that is compressed.
pub(super) fn check_extensions(root: &mut Root) -> Result<(Vec<String>, Vec<String>), SceneError> {
    let required = std::mem::take(&mut root.extensions_required);
    let known =
        |name: &str| HARMLESS.contains(&name) || HARMLESS_PREFIXES.iter().any(|p| name.starts_with(p));
    let mut notes = Vec::new();
    for name in &required {
        if let Some((extension, title)) = COMPRESSED.iter().find(|(extension, _)| extension == name) {
            let problem = format!("{extension}: geometry compressed with {title}, which is not read");
            let expected = "an uncompressed file (gltf-transform: `copy` undoes it)";
            return Err(SceneError::new("extensionsRequired", problem, expected));
        }
        if !known(name) {
            let shown: String = name.chars().take(80).collect();
            notes.push(format!("it requires the extension {}, which is not read", shown.escape_debug()));
        }
    }
    Ok((required, notes))
}
