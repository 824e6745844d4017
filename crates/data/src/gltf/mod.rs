//! Skinned glTF 2.0 (`.glb`, `.gltf`) through the `gltf` crate, which parses and validates the document. Buffers and
//! accessors are checked here before the crate reads them, since it trusts their extents.

mod buffers;
mod clip;
mod mesh;
mod scales;
mod splats;
mod text;
mod write;

pub use clip::Clip;
pub(crate) use splats::has_splats;
pub use splats::{Splats, load_splats};
pub use write::{Motion, write_body, write_skinned_splats, write_splats};

use super::Error;
use ::gltf::Node;
use buffers::Source;
use glam::{DAffine3, DQuat, DVec3, Mat4};
use skinsplat_core::scene::{Body, LocalTransform, RestBody, SceneError, Skeleton};
use std::collections::HashMap;
use std::path::Path;

/// A skinned character: its body and its clips.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The body. Vertices are in bind space, as the file stores them; skeleton nodes are the joints, then those
    /// ancestors that only carry them.
    pub body: Body,
    /// Its animations.
    pub clips: Vec<Clip>,
    /// What was repaired or not read, a clause each.
    pub notes: Vec<String>,
}

impl Rig {
    /// Loads a `.glb` or `.gltf` file, with its external buffers or data URIs. All meshes with a skin become one body,
    /// in the order of nodes and primitives. Weights that sum to 0.97 to 1.03 are divided by their sum, vertices without
    /// weights hang on the first joint that they name, and channels without a node are ignored; the notes say so, and
    /// which joints mirror or scale by 0.
    ///
    /// # Errors
    /// An invalid document, compressed geometry, buffers or accessors that are missing or too short, a buffer that is no
    /// regular file of the document's folder, no skinned mesh, weights of another sum, a node hierarchy that is no forest,
    /// clips of more values than the file has bytes (and than 2^20).
    pub fn load(path: &Path) -> Result<Self, Error> {
        let source = Source::open(path)?;
        let joints = Joints::collect(&source).map_err(|e| Error::scene(path, e))?;
        let mut notes = source.notes.clone();
        let mesh = mesh::collect(&source, &joints, &mut notes).map_err(|e| Error::scene(path, e))?;
        let clips = clip::collect(&source, &joints).map_err(|e| Error::scene(path, e))?;
        let skeleton = joints.skeleton().map_err(|e| Error::scene(path, e))?;
        let rest = RestBody {
            skeleton,
            vertices: mesh.vertices,
            faces: mesh.faces,
            weights: mesh.weights,
            uv: mesh.uv,
            pose_directions: Vec::new(),
        };
        rest.validate().map_err(|e| Error::scene(path, e))?;
        notes.extend(scales::of_rest(&rest).map_err(|e| Error::scene(path, e))?);
        Ok(Self { body: Body { rest, shape: None }, clips, notes })
    }
}

/// The base-colour image of the first textured material, in the orientation of the file (v down from the top row).
/// `None` if there is none.
///
/// # Errors
/// As [`Rig::load`] for the document, and for an image that cannot be decoded.
pub fn base_colour(path: &Path) -> Result<Option<skinsplat_core::scene::Image>, Error> {
    let source = Source::open(path)?;
    let textures =
        source.document.materials().filter_map(|m| m.pbr_metallic_roughness().base_color_texture());
    let Some(image) = textures.map(|t| t.texture().source()).next() else { return Ok(None) };
    let bytes = source.image_bytes(&image).map_err(|e| Error::scene(path, e))?;
    super::frames::image_from_bytes(path, &bytes).map(|(image, _)| Some(image))
}

/// Which nodes are joints, and how the skeleton numbers them.
pub(super) struct Joints<'a> {
    source: &'a Source,
    /// glTF node per skeleton node: joints first, then ancestors.
    nodes: Vec<usize>,
    /// Skeleton node of each glTF node that is one.
    places: HashMap<usize, usize>,
    inverse_binds: Vec<DAffine3>,
}

impl<'a> Joints<'a> {
    fn collect(source: &'a Source) -> Result<Self, SceneError> {
        let (mut nodes, mut places) = (Vec::new(), HashMap::new());
        let mut inverse_binds = Vec::new();
        for node in source.document.nodes().filter(|node| node.mesh().is_some()) {
            let Some(skin) = node.skin() else { continue };
            let field = format!("skins[{}]", skin.index());
            let binds = match skin.inverse_bind_matrices() {
                Some(accessor) => source.matrices(&accessor, &format!("{field}.inverseBindMatrices"))?,
                None => vec![Mat4::IDENTITY; skin.joints().count()],
            };
            if binds.len() < skin.joints().count() {
                let expected = format!("{} (joints)", skin.joints().count());
                return Err(SceneError::new(
                    field,
                    format!("{} inverse bind matrices", binds.len()),
                    expected,
                ));
            }
            for (joint, bind) in skin.joints().zip(binds) {
                let bind = DAffine3::from_mat4(bind.as_dmat4());
                match places.get(&joint.index()) {
                    None => {
                        places.insert(joint.index(), nodes.len());
                        nodes.push(joint.index());
                        inverse_binds.push(bind);
                    }
                    Some(&known) if inverse_binds[known] == bind => {}
                    Some(_) => {
                        let problem = format!("node {} has two inverse bind matrices", joint.index());
                        return Err(SceneError::new(field, problem, "skins that agree on shared joints"));
                    }
                }
            }
        }
        if nodes.is_empty() {
            return Err(SceneError::new("skins", "no mesh with a skin", "a skinned mesh"));
        }
        let parents = source.parents()?;
        for joint in 0..nodes.len() {
            let mut ancestor = parents[nodes[joint]];
            while let Some(node) = ancestor.filter(|node| !places.contains_key(node)) {
                places.insert(node, nodes.len());
                nodes.push(node);
                ancestor = parents[node];
            }
        }
        Ok(Self { source, nodes, places, inverse_binds })
    }

    /// The skeleton node of a glTF node.
    pub(super) fn index_of(&self, node: &Node) -> Option<usize> {
        self.places.get(&node.index()).copied()
    }

    /// Number of joints.
    pub(super) fn count(&self) -> usize {
        self.inverse_binds.len()
    }

    fn skeleton(&self) -> Result<Skeleton, SceneError> {
        let all: Vec<Node> = self.source.document.nodes().collect();
        let parents = self.source.parents()?;
        let name = |&i: &usize| all[i].name().map_or_else(|| format!("joint {i}"), str::to_owned);
        let parent = |&i: &usize| parents[i].and_then(|p| self.places.get(&p).copied());
        let local = |&i: &usize| {
            let (translation, [x, y, z, w], scale) = all[i].transform().decomposed();
            LocalTransform {
                translation: DVec3::from_array(translation.map(f64::from)),
                rotation: unit(DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into())),
                scale: DVec3::from_array(scale.map(f64::from)),
            }
        };
        Skeleton::new(
            self.nodes.iter().map(name).collect(),
            self.nodes.iter().map(parent).collect(),
            self.nodes.iter().map(local).collect(),
            self.inverse_binds.clone(),
        )
    }
}

/// A quaternion of unit length to f64 precision; files hold f32. A zero quaternion is left for validation to find.
fn unit(q: DQuat) -> DQuat {
    if q.length_squared() > 0.0 { q.normalize() } else { DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 0.0) }
}
