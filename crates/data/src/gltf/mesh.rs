//! The skinned meshes of a glTF document as one mesh.

use super::Joints;
use super::buffers::{Integers, Source};
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::mesh::{Mode, Primitive};
use ::gltf::{Accessor, Semantic, Skin};
use glam::DVec3;
use skinsplat_core::scene::{SceneError, SkinWeights, Uv};

pub(super) struct Mesh {
    pub(super) vertices: Vec<DVec3>,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) weights: SkinWeights,
    pub(super) uv: Option<Uv>,
}

/// All skinned primitives, one after the other. A mesh that many nodes show may not grow beyond what the file could hold.
pub(super) fn collect(source: &Source, joints: &Joints, notes: &mut Vec<String>) -> Result<Mesh, SceneError> {
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    let mut rows: Vec<Vec<(usize, f32)>> = Vec::new();
    let mut coordinates = Vec::new();
    for node in source.document.nodes() {
        let (Some(mesh), Some(skin)) = (node.mesh(), node.skin()) else { continue };
        // Gaussians are an avatar's, not the body's.
        for primitive in mesh.primitives().filter(|primitive| !super::splats::is_splats(primitive)) {
            let part = Part {
                source,
                field: format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index()),
                primitive,
            };
            let first = vertices.len() as u32;
            let positions = part.positions()?;
            faces.extend(
                part.faces(positions.len())?.iter().map(|face| face.map(|k| k.saturating_add(first))),
            );
            coordinates.extend(part.texture_coordinates(positions.len())?);
            rows.extend(part.influences(&skin, joints, positions.len(), notes)?);
            vertices.extend(positions);
            if vertices.len() > source.size {
                let problem = format!("{} vertices of a file of {} bytes", vertices.len(), source.size);
                return Err(SceneError::new(
                    part.field,
                    problem,
                    "nodes that do not repeat a mesh over and over",
                ));
            }
        }
    }
    let uv = (coordinates.len() == vertices.len()).then(|| Uv { coordinates, faces: faces.clone() });
    Ok(Mesh { vertices, faces, weights: SkinWeights::from_rows(rows, joints.count())?, uv })
}

/// A primitive and where it stands in the document.
pub(super) struct Part<'a> {
    pub(super) source: &'a Source,
    pub(super) field: String,
    pub(super) primitive: Primitive<'a>,
}

impl Part<'_> {
    fn attribute(&self, semantic: &Semantic) -> Option<(Accessor<'_>, String)> {
        let accessor = self.primitive.get(semantic)?;
        Some((accessor, format!("{}.{}", self.field, semantic.to_string())))
    }

    /// Floats, or integers of 8 and 16 bits, normalised or not (KHR_mesh_quantization).
    fn positions(&self) -> Result<Vec<DVec3>, SceneError> {
        let Some((accessor, field)) = self.attribute(&Semantic::Positions) else {
            return Err(SceneError::new(format!("{}.POSITION", self.field), "missing", "vertex positions"));
        };
        Ok(self
            .source
            .vectors::<3>(&accessor, Dimensions::Vec3, Integers::AsSaid, &field)?
            .into_iter()
            .map(DVec3::from)
            .collect())
    }

    fn faces(&self, vertices: usize) -> Result<Vec<[u32; 3]>, SceneError> {
        if self.primitive.mode() != Mode::Triangles {
            let problem = format!("{:?}", self.primitive.mode());
            return Err(SceneError::new(format!("{}.mode", self.field), problem, "triangles"));
        }
        let field = format!("{}.indices", self.field);
        let indices: Vec<u32> = match self.primitive.indices() {
            None => (0..vertices as u32).collect(),
            Some(a) => match a.data_type() {
                DataType::U8 => {
                    widened(self.source.items::<u8>(&a, (DataType::U8, Dimensions::Scalar), &field)?)
                }
                DataType::U16 => {
                    widened(self.source.items::<u16>(&a, (DataType::U16, Dimensions::Scalar), &field)?)
                }
                _ => self.source.items(&a, (DataType::U32, Dimensions::Scalar), &field)?,
            },
        };
        if let Some(&index) = indices.iter().find(|&&i| i as usize >= vertices) {
            return Err(SceneError::new(
                field,
                format!("vertex {index}"),
                format!("indices below {vertices}"),
            ));
        }
        if !indices.len().is_multiple_of(3) {
            return Err(SceneError::new(field, format!("{} indices", indices.len()), "three per triangle"));
        }
        Ok(indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect())
    }

    /// TEXCOORD_0 in OBJ convention (v up; glTF's runs down); none if the primitive has none.
    fn texture_coordinates(&self, vertices: usize) -> Result<Vec<[f32; 2]>, SceneError> {
        let Some((accessor, field)) = self.attribute(&Semantic::TexCoords(0)) else { return Ok(Vec::new()) };
        let values = self.source.vectors::<2>(&accessor, Dimensions::Vec2, Integers::AsSaid, &field)?;
        same_count(&field, values.len(), vertices)?;
        Ok(values.iter().map(|[u, v]| [*u as f32, 1.0 - *v as f32]).collect())
    }

    /// JOINTS_n and WEIGHTS_n for n = 0, 1, …, with the skin's joint numbers replaced by the skeleton's.
    pub(super) fn influences(
        &self,
        skin: &Skin,
        joints: &Joints,
        vertices: usize,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Vec<(usize, f32)>>, SceneError> {
        let skeleton: Vec<Option<usize>> = skin.joints().map(|node| joints.index_of(&node)).collect();
        let mut rows = vec![Vec::new(); vertices];
        let mut first_joints = Vec::new();
        for set in 0.. {
            let joints = self.attribute(&Semantic::Joints(set));
            let weights = self.attribute(&Semantic::Weights(set));
            let ((joints, joints_field), (weights, weights_field)) = match (joints, weights) {
                (Some(joints), Some(weights)) => (joints, weights),
                (None, None) if set > 0 => break,
                _ => {
                    let field = format!("{}.JOINTS_{set}, WEIGHTS_{set}", self.field);
                    return Err(SceneError::new(field, "missing", "both, one per vertex"));
                }
            };
            let indices: Vec<[u16; 4]> = match joints.data_type() {
                DataType::U8 => {
                    let kind = (DataType::U8, Dimensions::Vec4);
                    let narrow: Vec<[u8; 4]> = self.source.items(&joints, kind, &joints_field)?;
                    narrow.iter().map(|row| row.map(u16::from)).collect()
                }
                _ => self.source.items(&joints, (DataType::U16, Dimensions::Vec4), &joints_field)?,
            };
            let weights =
                self.source.vectors::<4>(&weights, Dimensions::Vec4, Integers::Fractions, &weights_field)?;
            let weights: Vec<[f32; 4]> = weights.iter().map(|row| row.map(|w| w as f32)).collect();
            same_count(&joints_field, indices.len(), vertices)?;
            same_count(&weights_field, weights.len(), vertices)?;
            if set == 0 {
                first_joints =
                    indices.iter().map(|row| skeleton.get(usize::from(row[0])).copied().flatten()).collect();
            }
            for (i, (row, (indices, weights))) in
                rows.iter_mut().zip(indices.iter().zip(&weights)).enumerate()
            {
                for (&joint, &weight) in indices.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
                    check_weight(weight, &weights_field, i)?;
                    let Some(&Some(joint)) = skeleton.get(usize::from(joint)) else {
                        let expected = format!("below the skin's {} joints", skeleton.len());
                        return Err(SceneError::new(
                            format!("{joints_field}[{i}]"),
                            format!("joint {joint}"),
                            expected,
                        ));
                    };
                    row.push((joint, weight));
                }
            }
        }
        self.repair(&mut rows, &first_joints, notes)?;
        Ok(rows)
    }

    /// Rows without weights hang on the first joint that they name, as three.js has it; sums that are off by a little are
    /// made one.
    fn repair(
        &self,
        rows: &mut [Vec<(usize, f32)>],
        first_joints: &[Option<usize>],
        notes: &mut Vec<String>,
    ) -> Result<(), SceneError> {
        let mut empty = 0;
        for (row, first) in rows.iter_mut().zip(first_joints) {
            if let (true, Some(joint)) = (row.is_empty(), first) {
                row.push((*joint, 1.0));
                empty += 1;
            }
        }
        if empty > 0 {
            let count = rows.len();
            notes.push(format!(
                "{}: {empty} of {count} vertices have no weights and hang on the first joint that they name",
                self.field
            ));
        }
        notes.extend(SkinWeights::normalise(rows).map(|note| format!("{}: {note}", self.field)));
        let sum = |row: &Vec<(usize, f32)>| row.iter().map(|(_, w)| f64::from(*w)).sum::<f64>();
        let off = |row: &Vec<(usize, f32)>| {
            let sum = sum(row);
            sum.is_nan() || (sum - 1.0).abs() > SkinWeights::SUM_TOLERANCE
        };
        match rows.iter().position(off) {
            Some(i) => {
                let field = format!("{}.WEIGHTS_0[{i}]", self.field);
                Err(SceneError::new(field, format!("sum {}", sum(&rows[i])), "weights that sum to 1"))
            }
            None => Ok(()),
        }
    }
}

fn widened<T: Into<u32>>(values: Vec<T>) -> Vec<u32> {
    values.into_iter().map(Into::into).collect()
}

fn check_weight(weight: f32, field: &str, vertex: usize) -> Result<(), SceneError> {
    if weight.is_finite() && weight >= 0.0 {
        return Ok(());
    }
    let expected = "a finite number, at least 0";
    Err(SceneError::new(format!("{field}[{vertex}]"), format!("weight {weight}"), expected))
}

fn same_count(field: &str, found: usize, vertices: usize) -> Result<(), SceneError> {
    if found == vertices {
        return Ok(());
    }
    Err(SceneError::new(field, format!("{found} values"), format!("{vertices} (vertices)")))
}
