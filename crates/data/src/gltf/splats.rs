//! KHR_gaussian_splatting: reading Gaussians from `.glb` and `.gltf`.

use super::buffers::{Integers, Source};
use super::{Error, Joints, mesh};
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::mesh::{Mode, Primitive};
use ::gltf::{Accessor, Node, Semantic};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use skinsplat_core::math::{portable, rotation, sh};
use skinsplat_core::scene::{Avatar, Binding, Gaussians, SceneError, SkinWeights};
use std::path::Path;

/// The names of the extension.
pub(super) mod names {
    /// The extension itself.
    pub(in super::super) const EXTENSION: &str = "KHR_gaussian_splatting";
    /// Unit quaternions (x, y, z, w).
    pub(in super::super) const ROTATION: &str = "KHR_gaussian_splatting:ROTATION";
    /// Standard deviations.
    pub(in super::super) const SCALE: &str = "KHR_gaussian_splatting:SCALE";
    /// Opacity in \[0, 1\].
    pub(in super::super) const OPACITY: &str = "KHR_gaussian_splatting:OPACITY";
    /// The kernel of 3DGS.
    pub(in super::super) const KERNEL: &str = "ellipse";
    /// Colours as they are displayed: what 3DGS fits.
    pub(in super::super) const DISPLAY: &str = "srgb_rec709_display";

    /// The attribute of an SH coefficient: degree l, n = m + l.
    pub(in super::super) fn coefficient(k: usize) -> String {
        let l = k.isqrt();
        format!("{EXTENSION}:SH_DEGREE_{l}_COEF_{}", k - l * l)
    }
}

/// Gaussians of a glTF file.
#[derive(Clone, Debug, PartialEq)]
pub struct Splats {
    /// In the axes of the scene; bound by skinning weights if the file has a skin, then in bind space.
    pub avatar: Avatar,
    /// What was assumed or not read, a clause each.
    pub notes: Vec<String>,
}

/// True if a glTF file speaks of Gaussians, compressed ones too, judged by its text.
pub(crate) fn has_splats(bytes: &[u8]) -> bool {
    let Ok((json, _)) = super::text::split(bytes) else { return false };
    let needle = b"KHR_gaussian_splatting";
    json.windows(needle.len()).any(|window| window == needle)
}

/// Reads the Gaussians of all nodes, one after the other. Transforms of nodes are applied to means, rotations, scales and SH;
/// with a skin Gaussians stay in bind space, as glTF asks, and the joints are numbered as in [`Rig::load`](super::Rig::load)
/// of the same file.
///
/// # Errors
/// An invalid document, an extension that it requires and that is not read (by its name), missing or incomplete
/// attributes, a kernel other than `ellipse`, nodes that scale by unequal factors, values that [`Avatar::validate`] refuses.
pub fn load_splats(path: &Path) -> Result<Splats, Error> {
    let source = Source::open(path)?;
    collect(&source).map_err(|e| Error::scene(path, e))
}

fn collect(source: &Source) -> Result<Splats, SceneError> {
    if let Some(name) = source.required.iter().find(|name| *name != names::EXTENSION) {
        let problem = format!("{}, which is not read", name.escape_debug());
        return Err(SceneError::new(
            "extensionsRequired",
            problem,
            "KHR_gaussian_splatting without compression",
        ));
    }
    let mut all = Gaussians::default();
    let mut rows: Vec<Vec<(usize, f32)>> = Vec::new();
    let mut notes = Vec::new();
    let parents = source.parents()?;
    let nodes: Vec<Node> = source.document.nodes().collect();
    let skinned = nodes.iter().any(|node| node.skin().is_some() && node.mesh().is_some());
    let joints = if skinned { Some(Joints::collect(source)?) } else { None };
    for node in &nodes {
        let Some(mesh) = node.mesh() else { continue };
        for primitive in mesh.primitives().filter(is_splats) {
            let field = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
            let part = Part { source, field: field.clone(), primitive };
            let mut gaussians = part.gaussians(&mut notes)?;
            match (node.skin(), &joints) {
                (Some(skin), Some(joints)) => {
                    let part = mesh::Part { source, field, primitive: part.primitive };
                    rows.extend(part.influences(&skin, joints, gaussians.len(), &mut notes)?);
                }
                _ => place(&mut gaussians, world(&nodes, &parents, node.index()), &field)?,
            }
            append(&mut all, gaussians, &part_field(mesh.index()))?;
        }
    }
    let beside = nodes.iter().filter_map(Node::mesh).flat_map(|mesh| mesh.primitives().collect::<Vec<_>>());
    let beside = beside.filter(|primitive| !is_splats(primitive)).count();
    if beside > 0 && !skinned {
        notes.push(format!("{beside} primitives without Gaussians beside them are not read"));
    }
    if all.is_empty() {
        return Err(SceneError::new("meshes", "no node with KHR_gaussian_splatting", "Gaussians"));
    }
    let binding = match joints {
        Some(joints) if rows.len() == all.len() => {
            Binding::Vertex(SkinWeights::from_rows(rows, joints.count())?)
        }
        Some(_) => {
            let problem = format!("a skin for {} of {} Gaussians", rows.len(), all.len());
            return Err(SceneError::new("nodes", problem, "a skin for all or none"));
        }
        None => Binding::Static,
    };
    let avatar = Avatar { gaussians: all, binding };
    avatar.validate(None)?;
    Ok(Splats { avatar, notes })
}

fn part_field(mesh: usize) -> String {
    format!("meshes[{mesh}]")
}

/// True for a primitive of Gaussians.
pub(super) fn is_splats(primitive: &Primitive<'_>) -> bool {
    own_attributes(primitive).next().is_some()
}

/// The attributes of a primitive that are the extension's.
fn own_attributes<'p>(primitive: &'p Primitive<'_>) -> impl Iterator<Item = String> + 'p {
    primitive.attributes().filter_map(|(semantic, _)| match semantic {
        Semantic::Extras(name) if name.starts_with(names::EXTENSION) => Some(name),
        _ => None,
    })
}

/// The world transform of a node.
fn world(nodes: &[Node<'_>], parents: &[Option<usize>], node: usize) -> DAffine3 {
    let mut transform = DAffine3::IDENTITY;
    let mut next = Some(node);
    while let Some(index) = next {
        let columns = nodes[index].transform().matrix();
        transform = DAffine3::from_mat4(glam::Mat4::from_cols_array_2d(&columns).as_dmat4()) * transform;
        next = parents[index];
    }
    transform
}

/// A primitive and where it stands.
struct Part<'a> {
    source: &'a Source,
    field: String,
    primitive: Primitive<'a>,
}

impl Part<'_> {
    fn attribute(&self, name: &str) -> Option<(Accessor<'_>, String)> {
        let semantic = match name {
            "POSITION" => Semantic::Positions,
            other => Semantic::Extras(other.to_owned()),
        };
        Some((self.primitive.get(&semantic)?, format!("{}.{name}", self.field)))
    }

    fn required(&self, name: &str) -> Result<(Accessor<'_>, String), SceneError> {
        self.attribute(name).ok_or_else(|| {
            SceneError::new(
                format!("{}.{name}", self.field),
                "missing",
                "an attribute of KHR_gaussian_splatting",
            )
        })
    }

    fn vectors<const N: usize>(&self, name: &str, kind: Dimensions) -> Result<Vec<[f32; N]>, SceneError>
    where
        [i8; N]: ::gltf::accessor::Item,
        [u8; N]: ::gltf::accessor::Item,
        [i16; N]: ::gltf::accessor::Item,
        [u16; N]: ::gltf::accessor::Item,
        [f32; N]: ::gltf::accessor::Item,
    {
        let (accessor, field) = self.required(name)?;
        let values = self.source.vectors::<N>(&accessor, kind, Integers::AsSaid, &field)?;
        Ok(values.into_iter().map(|row| row.map(|v| v as f32)).collect())
    }

    /// Floats, or integers that stand for fractions.
    fn opacities(&self) -> Result<Vec<f32>, SceneError> {
        let (accessor, field) = self.required(names::OPACITY)?;
        let kind = |data| (data, Dimensions::Scalar);
        Ok(match accessor.data_type() {
            DataType::U8 => {
                let values: Vec<u8> = self.source.items(&accessor, kind(DataType::U8), &field)?;
                values.iter().map(|&v| f32::from(v) / 255.0).collect()
            }
            DataType::U16 => {
                let values: Vec<u16> = self.source.items(&accessor, kind(DataType::U16), &field)?;
                values.iter().map(|&v| f32::from(v) / 65535.0).collect()
            }
            _ => self.source.items(&accessor, kind(DataType::F32), &field)?,
        })
    }

    fn gaussians(&self, notes: &mut Vec<String>) -> Result<Gaussians, SceneError> {
        if self.primitive.mode() != Mode::Points {
            let problem = format!("{:?}", self.primitive.mode());
            return Err(SceneError::new(format!("{}.mode", self.field), problem, "points"));
        }
        self.check_extension(notes)?;
        let means = self.vectors::<3>("POSITION", Dimensions::Vec3)?;
        let rotations = self.vectors::<4>(names::ROTATION, Dimensions::Vec4)?;
        let scales = self.vectors::<3>(names::SCALE, Dimensions::Vec3)?;
        let opacities = self.opacities()?;
        let sh_degree = self.degree()?;
        let bands: Vec<Vec<[f32; 3]>> = (0..sh::count(sh_degree))
            .map(|k| self.vectors::<3>(&names::coefficient(k), Dimensions::Vec3))
            .collect::<Result<_, _>>()?;
        self.note_unread(bands.len(), notes);
        let n = means.len();
        let counts = [
            (names::ROTATION, rotations.len()),
            (names::SCALE, scales.len()),
            (names::OPACITY, opacities.len()),
        ];
        let bands_too = bands.iter().enumerate().map(|(k, band)| (names::coefficient(k), band.len()));
        let mut all = counts.into_iter().map(|(name, count)| (name.to_owned(), count)).chain(bands_too);
        if let Some((name, count)) = all.find(|(_, count)| *count != n) {
            return Err(SceneError::new(
                format!("{}.{name}", self.field),
                format!("{count} values"),
                format!("{n}, as positions"),
            ));
        }
        for (i, opacity) in opacities.iter().enumerate() {
            if !(0.0..=1.0).contains(opacity) {
                let field = format!("{}.{}[{i}]", self.field, names::OPACITY);
                return Err(SceneError::new(field, format!("{opacity}"), "an opacity in [0, 1]"));
            }
        }
        if let Some(i) = scales.iter().flatten().position(|s| !(s.is_finite() && *s >= 0.0)) {
            let field = format!("{}.{}[{}]", self.field, names::SCALE, i / 3);
            return Err(SceneError::new(
                field,
                format!("{:?}", scales[i / 3]),
                "standard deviations, at least 0",
            ));
        }
        Ok(Gaussians {
            means: means.into_iter().map(Vec3::from_array).collect(),
            rotations: rotations.into_iter().map(|[x, y, z, w]| [w, x, y, z]).collect(),
            log_scales: scales.into_iter().map(|s| Vec3::from_array(s.map(logarithm))).collect(),
            opacity_logits: opacities.into_iter().map(logit).collect(),
            sh_degree,
            sh: (0..n).flat_map(|i| bands.iter().map(move |band| band[i])).collect(),
        })
    }

    /// Says which attributes of the extension are not read, and how they would be drawn where that is not how they are here.
    fn note_unread(&self, bands: usize, notes: &mut Vec<String>) {
        let known: Vec<String> = [names::ROTATION, names::SCALE, names::OPACITY]
            .map(str::to_owned)
            .into_iter()
            .chain((0..bands).map(names::coefficient))
            .collect();
        let unread: Vec<String> = own_attributes(&self.primitive)
            .filter(|name| !known.contains(name))
            .map(|name| name.escape_debug().to_string())
            .collect();
        if !unread.is_empty() {
            notes.push(format!("{}: not read: {}", self.field, unread.join(", ")));
        }
    }

    /// The highest degree of which all coefficients are there.
    ///
    /// # Errors
    /// A degree that is there in part.
    fn degree(&self) -> Result<usize, SceneError> {
        let is_there = |k: usize| self.attribute(&names::coefficient(k)).is_some();
        let known = (0..sh::count(sh::MAX_DEGREE)).take_while(|&k| is_there(k)).count();
        let further = (known..sh::count(sh::MAX_DEGREE)).any(is_there);
        let degree = (0..=sh::MAX_DEGREE).find(|&degree| sh::count(degree) == known);
        match degree {
            Some(degree) if !further => Ok(degree),
            _ => {
                let field = format!("{}.{}", self.field, names::coefficient(known));
                Err(SceneError::new(field, "missing", "complete degrees of SH"))
            }
        }
    }

    /// The kernel and the colour space.
    fn check_extension(&self, notes: &mut Vec<String>) -> Result<(), SceneError> {
        let extension = self.source.splat_extension(&self.primitive);
        let Some(extension) = extension else {
            notes.push(format!("{}: no {} object; kernel ellipse assumed", self.field, names::EXTENSION));
            return Ok(());
        };
        let kernel = extension["kernel"].as_str().unwrap_or(names::KERNEL);
        if kernel != names::KERNEL {
            let field = format!("{}.{}.kernel", self.field, names::EXTENSION);
            return Err(SceneError::new(field, kernel.escape_debug().to_string(), "ellipse"));
        }
        for (key, own) in [("projection", "perspective"), ("sortingMethod", "cameraDistance")] {
            let found = extension[key].as_str().unwrap_or(own);
            if found != own {
                let shown = found.chars().take(40).collect::<String>();
                notes.push(format!("{key} {}: not read, drawn as {own}", shown.escape_debug()));
            }
        }
        let space = extension["colorSpace"].as_str().unwrap_or(names::DISPLAY);
        if space != names::DISPLAY {
            notes.push(format!(
                "colour space {}: colours are taken as they are, as if for display",
                space.chars().take(40).collect::<String>().escape_debug()
            ));
        }
        Ok(())
    }
}

/// Moves Gaussians by the transform of their node: a rotation, one factor of scale, a translation.
fn place(gaussians: &mut Gaussians, world: DAffine3, field: &str) -> Result<(), SceneError> {
    if world == DAffine3::IDENTITY {
        return Ok(());
    }
    let scale = portable::cbrt(world.matrix3.determinant());
    let linear = world.matrix3 * (1.0 / scale);
    let gram = linear.transpose() * linear;
    if !(scale > 0.0 && gram.abs_diff_eq(DMat3::IDENTITY, 1e-5)) {
        let expected = "nodes that rotate, move, and scale by one factor above 0";
        return Err(SceneError::new(field, "a node that mirrors or scales unequally", expected));
    }
    let turn: DQuat = rotation::nearest_rotation(linear);
    let quat = [turn.w, turn.x, turn.y, turn.z];
    let turned = sh::Rotation::<f32>::from_quaternion(quat.map(|c| c as f32), gaussians.sh_degree);
    let count = gaussians.sh_count();
    for i in 0..gaussians.len() {
        let mean: DVec3 = gaussians.means[i].as_dvec3();
        gaussians.means[i] = world.transform_point3(mean).as_vec3();
        let own = gaussians.rotations[i].map(f64::from);
        gaussians.rotations[i] = rotation::multiply(quat, own).map(|c| c as f32);
        gaussians.log_scales[i] += portable::ln(scale) as f32;
        turned.apply(&mut gaussians.sh[i * count..(i + 1) * count]);
    }
    Ok(())
}

/// Puts Gaussians behind others of the same degree.
fn append(all: &mut Gaussians, more: Gaussians, field: &str) -> Result<(), SceneError> {
    if all.is_empty() {
        *all = more;
        return Ok(());
    }
    if all.sh_degree != more.sh_degree {
        let problem = format!("SH of degree {}", more.sh_degree);
        return Err(SceneError::new(field, problem, format!("{}, as before", all.sh_degree)));
    }
    all.means.extend(more.means);
    all.rotations.extend(more.rotations);
    all.log_scales.extend(more.log_scales);
    all.opacity_logits.extend(more.opacity_logits);
    all.sh.extend(more.sh);
    Ok(())
}

/// The number whose exponential is a standard deviation, with its very bits where there is one.
fn logarithm(scale: f32) -> f32 {
    inverse(scale, portable::ln(f64::from(scale)) as f32, portable::exp)
}

/// The number whose sigmoid is an opacity, with its very bits where there is one.
fn logit(opacity: f32) -> f32 {
    inverse(opacity, crate::ply::logit(f64::from(opacity)), |x| 1.0 / (1.0 + portable::exp(-x)))
}

/// Of the neighbours of an approximate inverse, that which gives the value back.
fn inverse(value: f32, near: f32, function: impl Fn(f32) -> f32) -> f32 {
    if !near.is_finite() {
        return near;
    }
    let (mut up, mut down) = (near, near);
    for _ in 0..8 {
        if function(up) == value {
            return up;
        }
        if function(down) == value {
            return down;
        }
        (up, down) = (up.next_up(), down.next_down());
    }
    near
}
