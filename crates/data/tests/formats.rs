//! Readers and writers of the data layer: what the formats allow, and what is refused, by file and field.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "formats/arrays.rs"]
mod arrays;
#[path = "formats/avatars.rs"]
mod avatars;
#[path = "formats/cameras_and_images.rs"]
mod cameras_and_images;
#[path = "../../../tests/support/files.rs"]
mod files;
#[path = "formats/gltf_builder.rs"]
mod gltf_builder;
#[path = "formats/gltf_dialects.rs"]
mod gltf_dialects;
#[path = "formats/gltf_files.rs"]
mod gltf_files;
#[path = "formats/pickles.rs"]
mod pickles;
#[path = "formats/smpl.rs"]
mod smpl;
#[path = "formats/smplx_package.rs"]
mod smplx_package;
#[path = "formats/splats.rs"]
mod splats;
#[path = "formats/splatting_avatar.rs"]
mod splatting_avatar;
#[path = "../../../tests/support/mod.rs"]
mod support;
