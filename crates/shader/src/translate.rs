//! The source in other languages, by naga.

use super::{SKINNING, VIEW, entry_points, view_source};
use naga::back::{glsl, hlsl, msl, spv};
use naga::proc::BoundsCheckPolicies;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Module, ResourceBinding, ShaderStage};
use sha2::{Digest, Sha256};
use std::fmt;

/// A file of `translations/`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Translation {
    /// Its path below `translations/`.
    pub path: String,
    /// What it holds.
    pub bytes: Vec<u8>,
}

/// A language that the source could not be put into.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TranslateError {
    language: &'static str,
    problem: String,
}

impl TranslateError {
    fn new(language: &'static str, problem: &dyn fmt::Display) -> Self {
        Self { language, problem: problem.to_string().split_whitespace().collect::<Vec<_>>().join(" ") }
    }
}

impl fmt::Display for TranslateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "skinning.wgsl to {}: {}", self.language, self.problem)
    }
}

impl std::error::Error for TranslateError {}

/// Groups and bindings of the source, in the order in which GLSL and MSL number them.
const BINDINGS: [(u32, u32); 13] =
    [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4), (0, 5), (0, 6), (0, 7), (0, 8), (0, 9), (1, 0), (1, 1), (1, 2)];

/// Every file: `skinning.hlsl` (shader model 5.1, a register space per group), `skinning.metal` (MSL 2.0, buffers 0 to 12 in the
/// order of groups and bindings; 13, lengths of arrays, is never read), `skinning.spv` (SPIR-V 1.3, all entry points), `glsl/ENTRY_POINT.comp` (GLSL 4.30, bindings as in MSL).
/// `view.frag` (GLSL ES 3.00,
/// the fragment shader of [`VIEW`]). `SOURCE.sha256` is the sources' digest. Indices are not
/// checked: a joint that is not there is the caller's fault.
///
/// # Errors
/// The source is no valid WGSL, or a language lacks something.
pub fn translations() -> Result<Vec<Translation>, TranslateError> {
    let (module, info) = parsed(SKINNING)?;
    let text = |path: &str, text: String| Translation { path: path.to_owned(), bytes: text.into_bytes() };
    let mut files = vec![
        text("skinning.hlsl", headed(&hlsl(&module, &info)?)),
        text("skinning.metal", headed(&msl(&module, &info)?)),
        Translation { path: "skinning.spv".to_owned(), bytes: spirv(&module, &info)? },
    ];
    let digest: String =
        Sha256::digest([SKINNING, VIEW].concat()).iter().map(|byte| format!("{byte:02x}")).collect();
    files.push(text("SOURCE.sha256", format!("{digest}\n")));
    for entry_point in entry_points() {
        let source = glsl(&module, &info, &entry_point)?;
        files.push(text(&format!("glsl/{entry_point}.comp"), after_version(&source)));
    }
    files.push(view()?);
    Ok(files)
}

/// The skinning of the page that plays an avatar, as a fragment shader of WebGL 2.
fn view() -> Result<Translation, TranslateError> {
    let (module, info) = parsed(&view_source())?;
    let options = glsl::Options {
        version: glsl::Version::Embedded { version: 300, is_webgl: true },
        writer_flags: glsl::WriterFlags::empty(),
        binding_map: Default::default(),
        zero_initialize_workgroup_memory: false,
    };
    let source = glsl_of(&module, &info, &options, ShaderStage::Fragment, "posed")?;
    Ok(Translation { path: "view.frag".to_owned(), bytes: after_version(&source).into_bytes() })
}

/// The header of a GLSL file comes after the version, which has to be the first line.
fn after_version(source: &str) -> String {
    let (version, rest) = source.split_once('\n').unwrap_or((source, ""));
    format!("{version}\n{}", headed(rest))
}

fn parsed(source: &str) -> Result<(Module, ModuleInfo), TranslateError> {
    let module = naga::front::wgsl::parse_str(source)
        .map_err(|e| TranslateError::new("naga's IR", &e.emit_to_string(source)))?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let info = validator.validate(&module).map_err(|e| TranslateError::new("valid WGSL", &e.into_inner()))?;
    Ok((module, info))
}

/// Says where a text comes from.
fn headed(text: &str) -> String {
    format!(
        "// Made from shaders/skinning.wgsl by naga: edit that. MIT OR Apache-2.0.\n{}\n",
        text.trim_end()
    )
}

fn hlsl(module: &Module, info: &ModuleInfo) -> Result<String, TranslateError> {
    let options =
        hlsl::Options { restrict_indexing: false, force_loop_bounding: false, ..Default::default() };
    let every_entry_point = hlsl::PipelineOptions { entry_point: None };
    let mut text = String::new();
    hlsl::Writer::new(&mut text, &options, &every_entry_point)
        .write(module, info, None)
        .map_err(|e| TranslateError::new("HLSL", &e))?;
    Ok(text)
}

fn msl(module: &Module, info: &ModuleInfo) -> Result<String, TranslateError> {
    let resources = BINDINGS.iter().enumerate().map(|(slot, &(group, binding))| {
        let target = msl::BindTarget { buffer: Some(slot as u8), mutable: true, ..Default::default() };
        (ResourceBinding { group, binding }, target)
    });
    // naga hands the lengths of arrays to every entry point, read or not: here nothing reads them.
    let resources = msl::EntryPointResources {
        resources: resources.collect(),
        sizes_buffer: Some(BINDINGS.len() as u8),
        ..Default::default()
    };
    let options = msl::Options {
        lang_version: (2, 0),
        per_entry_point_map: entry_points().into_iter().map(|name| (name, resources.clone())).collect(),
        fake_missing_bindings: false,
        bounds_check_policies: BoundsCheckPolicies::default(),
        force_loop_bounding: false,
        ..Default::default()
    };
    let (text, names) = msl::write_string(module, info, &options, &msl::PipelineOptions::default())
        .map_err(|e| TranslateError::new("MSL", &e))?;
    for name in names.entry_point_names {
        name.map_err(|e| TranslateError::new("MSL", &e))?;
    }
    Ok(text)
}

fn spirv(module: &Module, info: &ModuleInfo) -> Result<Vec<u8>, TranslateError> {
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::LABEL_VARYINGS,
        force_loop_bounding: false,
        ..Default::default()
    };
    let words =
        spv::write_vec(module, info, &options, None).map_err(|e| TranslateError::new("SPIR-V", &e))?;
    Ok(words.iter().flat_map(|word| word.to_le_bytes()).collect())
}

fn glsl(module: &Module, info: &ModuleInfo, entry_point: &str) -> Result<String, TranslateError> {
    let numbered =
        |(slot, &(group, binding)): (usize, &(u32, u32))| (ResourceBinding { group, binding }, slot as u8);
    let options = glsl::Options {
        version: glsl::Version::Desktop(430),
        writer_flags: glsl::WriterFlags::empty(),
        binding_map: BINDINGS.iter().enumerate().map(numbered).collect(),
        zero_initialize_workgroup_memory: false,
    };
    glsl_of(module, info, &options, ShaderStage::Compute, entry_point)
}

fn glsl_of(
    module: &Module,
    info: &ModuleInfo,
    options: &glsl::Options,
    shader_stage: ShaderStage,
    entry_point: &str,
) -> Result<String, TranslateError> {
    let pipeline =
        glsl::PipelineOptions { shader_stage, entry_point: entry_point.to_owned(), multiview: None };
    let mut text = String::new();
    glsl::Writer::new(&mut text, module, info, options, &pipeline, BoundsCheckPolicies::default())
        .and_then(|mut writer| writer.write().map(drop))
        .map_err(|e| TranslateError::new("GLSL", &e))?;
    Ok(text)
}
