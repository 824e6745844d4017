//! The skinned meshes of a glTF document as one mesh.

use super::Joints;
use super::buffers::Source;
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

pub(super) fn collect(source: &Source, joints: &Joints) -> Result<Mesh, SceneError> {
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    let mut rows: Vec<Vec<(usize, f32)>> = Vec::new();
    let mut coordinates = Vec::new();
    for node in source.document.nodes() {
        let (Some(mesh), Some(skin)) = (node.mesh(), node.skin()) else { continue };
        for primitive in mesh.primitives() {
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
            rows.extend(part.influences(&skin, joints, positions.len())?);
            vertices.extend(positions);
        }
    }
    let uv = (coordinates.len() == vertices.len()).then(|| Uv { coordinates, faces: faces.clone() });
    Ok(Mesh { vertices, faces, weights: SkinWeights::from_rows(rows, joints.count())?, uv })
}

/// A primitive and where it stands in the document.
struct Part<'a> {
    source: &'a Source,
    field: String,
    primitive: Primitive<'a>,
}

impl Part<'_> {
    fn attribute(&self, semantic: &Semantic) -> Option<(Accessor<'_>, String)> {
        let accessor = self.primitive.get(semantic)?;
        Some((accessor, format!("{}.{}", self.field, semantic.to_string())))
    }

    fn positions(&self) -> Result<Vec<DVec3>, SceneError> {
        let Some((accessor, field)) = self.attribute(&Semantic::Positions) else {
            return Err(SceneError::new(format!("{}.POSITION", self.field), "missing", "vertex positions"));
        };
        let positions: Vec<[f32; 3]> =
            self.source.items(&accessor, (DataType::F32, Dimensions::Vec3), &field)?;
        Ok(positions.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect())
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
        let values = self.normalised::<2>(&accessor, Dimensions::Vec2, &field)?;
        same_count(&field, values.len(), vertices)?;
        Ok(values.iter().map(|[u, v]| [*u, 1.0 - v]).collect())
    }

    /// JOINTS_n and WEIGHTS_n for n = 0, 1, …, with the skin's joint numbers replaced by the skeleton's.
    fn influences(
        &self,
        skin: &Skin,
        joints: &Joints,
        vertices: usize,
    ) -> Result<Vec<Vec<(usize, f32)>>, SceneError> {
        let skeleton: Vec<Option<usize>> = skin.joints().map(|node| joints.index_of(&node)).collect();
        let mut rows = vec![Vec::new(); vertices];
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
            let weights = self.normalised::<4>(&weights, Dimensions::Vec4, &weights_field)?;
            same_count(&joints_field, indices.len(), vertices)?;
            same_count(&weights_field, weights.len(), vertices)?;
            for (i, (row, (indices, weights))) in
                rows.iter_mut().zip(indices.iter().zip(&weights)).enumerate()
            {
                for (&joint, &weight) in indices.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
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
        Ok(rows)
    }

    /// Floats, or 8 or 16 bit integers that stand for \[0, 1\].
    fn normalised<const N: usize>(
        &self,
        accessor: &Accessor,
        dimensions: Dimensions,
        field: &str,
    ) -> Result<Vec<[f32; N]>, SceneError>
    where
        [f32; N]: ::gltf::accessor::Item,
        [u8; N]: ::gltf::accessor::Item,
        [u16; N]: ::gltf::accessor::Item,
    {
        match accessor.data_type() {
            DataType::U8 => {
                let values: Vec<[u8; N]> = self.source.items(accessor, (DataType::U8, dimensions), field)?;
                Ok(values.iter().map(|row| row.map(|v| f32::from(v) / 255.0)).collect())
            }
            DataType::U16 => {
                let values: Vec<[u16; N]> =
                    self.source.items(accessor, (DataType::U16, dimensions), field)?;
                Ok(values.iter().map(|row| row.map(|v| f32::from(v) / 65535.0)).collect())
            }
            _ => self.source.items(accessor, (DataType::F32, dimensions), field),
        }
    }
}

fn widened<T: Into<u32>>(values: Vec<T>) -> Vec<u32> {
    values.into_iter().map(Into::into).collect()
}

fn same_count(field: &str, found: usize, vertices: usize) -> Result<(), SceneError> {
    if found == vertices {
        return Ok(());
    }
    Err(SceneError::new(field, format!("{found} values"), format!("{vertices} (vertices)")))
}
