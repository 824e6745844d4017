//! Avatars that SplattingAvatar exports: `point_cloud.ply`, and beside it `embedding.json` and the canonical mesh.
//!
//! The PLY holds *posed* positions and rotations; only its opacities, scales and SH are used. `embedding.json` holds the
//! face, the barycentric coordinates, the offset (`_xyz[2]`) and the rotation of each Gaussian relative to the canonical
//! mesh `cano_mesh`, which is the body in the pose of the first training frame and not in its rest pose.

use super::{Error, error, ply};
use glam::DVec3;
use serde::Deserialize;
use skinsplat_core::scene::body::vertex_normals;
use skinsplat_core::scene::{Avatar, Binding, FaceBinding};
use std::path::{Component, Path, PathBuf};

/// Name of the file of the Gaussians.
pub const GAUSSIANS: &str = "point_cloud.ply";
/// Name of the file that binds them.
const EMBEDDING: &str = "embedding.json";

/// True if a PLY of Gaussians has the embedding of an export beside it.
pub fn is_export(point_cloud: &Path) -> bool {
    point_cloud.file_name().is_some_and(|name| name == GAUSSIANS)
        && point_cloud.with_file_name(EMBEDDING).is_file()
}

/// An exported avatar and the mesh that it is canonical on.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Face-bound Gaussians; means and rotations on the canonical mesh.
    pub avatar: Avatar,
    /// Vertices of the canonical mesh, metres.
    pub vertices: Vec<DVec3>,
    /// Triangles of the canonical mesh, in the body model's order.
    pub faces: Vec<[u32; 3]>,
    /// The three files: Gaussians, embedding, mesh.
    pub files: Vec<PathBuf>,
}

/// Later files of the same program call the mesh `mesh_fn` and the coordinates `_sample_bary`.
#[derive(Deserialize)]
struct Embedding {
    #[serde(alias = "mesh_fn")]
    cano_mesh: String,
    sample_fidxs: Vec<u32>,
    #[serde(alias = "_sample_bary")]
    sample_bary: Vec<[f32; 3]>,
    #[serde(rename = "_xyz")]
    xyz: Vec<[f32; 3]>,
    #[serde(rename = "_rotation")]
    rotation: Vec<[f32; 4]>,
}

/// Loads `point_cloud.ply` with the `embedding.json` and the mesh beside it.
///
/// # Errors
/// Missing or inconsistent files, faces outside the mesh, whatever [`Avatar::validate`] refuses.
pub fn load(point_cloud: &Path) -> Result<Exported, Error> {
    let mut avatar = ply::read_avatar(point_cloud)?;
    let path = point_cloud.with_file_name(EMBEDDING);
    let embedding: Embedding =
        error::read_json(&path, "embedding", "cano_mesh, sample_fidxs, sample_bary, _xyz, _rotation")?;
    let n = avatar.gaussians.len();
    let counts = [
        ("sample_fidxs", embedding.sample_fidxs.len()),
        ("sample_bary", embedding.sample_bary.len()),
        ("_xyz", embedding.xyz.len()),
        ("_rotation", embedding.rotation.len()),
    ];
    if let Some((field, found)) = counts.into_iter().find(|(_, found)| *found != n) {
        return Err(Error::invalid(
            path,
            field,
            format!("{found} rows"),
            format!("{n} (Gaussians of the PLY)"),
        ));
    }
    let mesh = mesh_file(&path, &embedding.cano_mesh);
    let (vertices, faces) = read_obj(&mesh)?;
    let normals = vertex_normals(&vertices, &faces);
    for i in 0..n {
        let face = embedding.sample_fidxs[i];
        let Some(corners) = faces.get(face as usize) else {
            let expected = format!("an index below the mesh's {} faces", faces.len());
            return Err(Error::invalid(path, format!("sample_fidxs[{i}]"), format!("face {face}"), expected));
        };
        let at = |values: &[DVec3]| -> DVec3 {
            corners
                .iter()
                .zip(embedding.sample_bary[i])
                .map(|(&k, b)| values[k as usize] * f64::from(b))
                .sum()
        };
        let mean = at(&vertices) + at(&normals).normalize_or_zero() * f64::from(embedding.xyz[i][2]);
        avatar.gaussians.means[i] = mean.as_vec3();
    }
    avatar.gaussians.rotations = embedding.rotation;
    avatar.binding = Binding::Face(FaceBinding {
        faces: embedding.sample_fidxs,
        barycentric: embedding.sample_bary,
        offsets: embedding.xyz.iter().map(|xyz| xyz[2]).collect(),
    });
    avatar.validate(None).map_err(|e| Error::scene(&path, e))?;
    Ok(Exported { avatar, vertices, faces, files: vec![point_cloud.to_owned(), path, mesh] })
}

/// The file of the canonical mesh: where a relative name leads from the embedding on, without leaving its folder; else the
/// file of that name beside it, since absolute names are those of another machine.
fn mesh_file(embedding: &Path, name: &str) -> PathBuf {
    let stays =
        Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let below = embedding.with_file_name(name);
    if stays && below.is_file() {
        return below;
    }
    let last = name.rsplit(['/', '\\']).next().filter(|last| !last.is_empty() && *last != "..");
    embedding.with_file_name(last.unwrap_or("embedding.obj"))
}

/// Vertices and triangles of a Wavefront OBJ file; everything else in it is skipped.
fn read_obj(path: &Path) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), Error> {
    let text = error::read_text(path, "cano_mesh", "the canonical mesh as OBJ")?;
    let mut vertices = Vec::new();
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let bad =
            |expected: &str| Error::invalid(path, format!("line {}", number + 1), line.to_owned(), expected);
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let numbers = words.take(3).filter_map(|w| w.parse().ok()).filter(|v: &f64| v.is_finite());
                let vertex = <[f64; 3]>::try_from(numbers.collect::<Vec<f64>>()).ok();
                let vertex = vertex.ok_or_else(|| bad("v X Y Z with finite numbers"))?;
                vertices.push(DVec3::from_array(vertex));
            }
            Some("f") => {
                let first = |w: &str| w.split('/').next()?.parse::<u32>().ok()?.checked_sub(1);
                let corners: Option<Vec<u32>> = words.map(first).collect();
                let corners = corners.and_then(|c| <[u32; 3]>::try_from(c).ok());
                faces.push(corners.ok_or_else(|| bad("f A B C, a triangle of vertex numbers from 1"))?);
            }
            _ => {}
        }
    }
    if let Some(i) = faces.iter().position(|f| f.iter().any(|&k| k as usize >= vertices.len())) {
        let expected = format!("vertex numbers up to {}", vertices.len());
        return Err(Error::invalid(
            path,
            format!("face {i}"),
            format!("vertices {:?} (from 0)", faces[i]),
            expected,
        ));
    }
    Ok((vertices, faces))
}
