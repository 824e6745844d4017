//! Reading avatars.

use super::super::{Error, error};
use super::header::{Encoding, Header};
use super::rows::Rows;
use super::{REST_COUNTS, activated, compressed};
use glam::Vec3;
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, SceneError, SkinWeights};
use std::path::Path;

/// What kind of Gaussians a PLY file holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// Log scales, logits, SH channel by channel: that of 3DGS.
    #[default]
    Standard,
    /// Packed into 16 bytes per Gaussian in chunks of 256: SuperSplat and PlayCanvas.
    Compressed,
    /// Scales and opacities as they are drawn, SH coefficient by coefficient: iHuman's `SavePly`.
    Activated,
}

/// An avatar and what its file says about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// The avatar.
    pub avatar: Avatar,
    /// What kind of file it is.
    pub dialect: Dialect,
    /// How values are stored.
    pub encoding: Encoding,
    /// The body model that the avatar was bound to, as the writer named it.
    pub body: Option<String>,
    /// Comments in the header.
    pub comments: Vec<String>,
    /// Vertex properties and elements that were not read.
    pub ignored: Vec<String>,
    /// What was guessed or changed, a clause each.
    pub notes: Vec<String>,
}

/// Reads an avatar from a 3DGS PLY file, with its binding if the file holds one.
///
/// # Errors
/// As [`read`].
pub fn read_avatar(path: &Path) -> Result<Avatar, Error> {
    read(path).map(|stored| stored.avatar)
}

/// Reads an avatar and what else its file says: little-endian, big-endian or ascii; SH degree 0 to 3, as the number of
/// `f_rest` properties tells; in any [`Dialect`].
///
/// # Errors
/// A broken header, missing properties, a file shorter than its header says, values that [`Avatar::validate`] refuses.
pub fn read(path: &Path) -> Result<Stored, Error> {
    let bytes = error::read_bytes(path, "avatar", "a 3DGS PLY file")?;
    parse(&bytes).map_err(|e| Error::scene(path, e))
}

fn parse(bytes: &[u8]) -> Result<Stored, SceneError> {
    let header = Header::parse(bytes)?;
    let body = &bytes[header.length..];
    let Some(mut rows) = Rows::of(&header, "vertex", body)? else {
        return Err(SceneError::new("element vertex", "missing", "one vertex per Gaussian"));
    };
    let mut notes = of_comments(&header.comments);
    let (gaussians, dialect) = if compressed::is_packed(&rows) {
        (compressed::gaussians(&header, &mut rows, body)?, Dialect::Compressed)
    } else {
        refuse_others(&header, &rows)?;
        let stored = gaussians(&mut rows, &mut notes)?;
        match activated::recognised(&stored) {
            true => (activated::standard(stored), Dialect::Activated),
            false => (stored, Dialect::Standard),
        }
    };
    notes.extend(activated::note(&gaussians, dialect));
    let binding = binding(&mut rows, &mut notes)?;
    let avatar = Avatar { gaussians, binding };
    avatar.validate(None)?;
    let mut ignored = rows.ignored();
    notes.extend(of_ignored(&ignored));
    let read =
        |name: &str| name == "vertex" || (dialect == Dialect::Compressed && ["chunk", "sh"].contains(&name));
    let elements = header.elements.iter().filter(|element| !read(&element.name));
    ignored.extend(elements.map(|element| format!("element {}", element.name)));
    let body =
        header.comments.iter().find_map(|c| c.strip_prefix(super::write::BODY_COMMENT)).map(str::to_owned);
    Ok(Stored { avatar, dialect, encoding: header.encoding, body, comments: header.comments, ignored, notes })
}

/// Refuses what has nothing of a Gaussian but its place.
fn refuse_others(header: &Header, rows: &Rows<'_>) -> Result<(), SceneError> {
    let has = |names: &[&str]| names.iter().filter(|name| rows.has(name)).count();
    if has(&["x", "y", "z"]) < 3 || has(&["scale_0", "rot_0", "opacity", "f_dc_0"]) > 0 {
        return Ok(());
    }
    let surface = ["face", "tristrips"];
    let is_mesh = header.elements.iter().any(|element| surface.contains(&element.name.as_str()));
    let problem = if is_mesh { "a mesh, not Gaussians" } else { "a point cloud, not Gaussians" };
    let expected = "x y z, f_dc_*, opacity, scale_* and rot_* of each vertex, as 3DGS writes them";
    Err(SceneError::new("element vertex", problem, expected))
}

/// What the comments of Brush, splat-transform and Postshot say of the rasterizer.
fn of_comments(comments: &[String]) -> Vec<String> {
    let says = |text: &str| comments.iter().any(|comment| comment.trim().eq_ignore_ascii_case(text));
    let mut notes = Vec::new();
    if says("SplatRenderMode: mip") || says("antialiased 1") {
        notes.push("fitted for the antialiased rasterizer (`--antialiased`), says a comment".to_owned());
    }
    if says("SplatRenderMode: 2dgs") {
        notes.push("surfels of 2DGS, says a comment: drawn as Gaussians".to_owned());
    }
    notes
}

/// What properties that are not read say of the file.
fn of_ignored(ignored: &[String]) -> Option<String> {
    ignored.iter().any(|name| name == "binding_0").then(|| {
        "binding_0 is GaussianAvatars' triangle of each Gaussian: positions are local to a FLAME mesh that is not in the file"
            .to_owned()
    })
}

/// The vertices as a standard file has them.
fn gaussians(rows: &mut Rows<'_>, notes: &mut Vec<String>) -> Result<Gaussians, SceneError> {
    let position = rows.columns(&["x", "y", "z"])?;
    let in_plane = rows.columns(&["scale_0", "scale_1"])?;
    // 2DGS writes two scales
    let is_flat = !rows.has("scale_2") && !rows.has("scale_3");
    let across = if is_flat { None } else { Some(rows.column("scale_2")?) };
    if is_flat {
        notes.push(
            "two scales per Gaussian, as 2DGS writes them: drawn as discs without thickness".to_owned(),
        );
    }
    let rotation = rows.columns(&["rot_0", "rot_1", "rot_2", "rot_3"])?;
    let [opacity] = rows.columns(&["opacity"])?;
    let dc = rows.columns(&["f_dc_0", "f_dc_1", "f_dc_2"])?;
    let rest = rows.numbered("f_rest_")?;
    let Some(sh_degree) = REST_COUNTS.iter().position(|&n| n == rest.len()) else {
        let problem = format!("{} properties", rest.len());
        return Err(SceneError::new("f_rest", problem, "0, 9, 24 or 45 (SH degree 0 to 3)"));
    };
    let per_channel = rest.len() / 3;
    let mut g = Gaussians { sh_degree, ..Gaussians::default() };
    let n = rows.len();
    g.means.reserve_exact(n);
    g.rotations.reserve_exact(n);
    g.log_scales.reserve_exact(n);
    g.opacity_logits.reserve_exact(n);
    g.sh.reserve_exact(n * (per_channel + 1));
    // One pass over the rows: they are longer than a cache line.
    for i in 0..n {
        g.means.push(Vec3::from_array(position.map(|c| rows.value(i, c))));
        g.rotations.push(rotation.map(|c| rows.value(i, c)));
        let [first, second] = in_plane.map(|c| rows.value(i, c));
        let third = across.map_or(f32::NEG_INFINITY, |c| rows.value(i, c));
        g.log_scales.push(Vec3::new(first, second, third));
        g.opacity_logits.push(rows.value(i, opacity));
        g.sh.push(dc.map(|c| rows.value(i, c)));
        let coefficient = |k: usize| [0, 1, 2].map(|channel| rows.value(i, rest[channel * per_channel + k]));
        g.sh.extend((0..per_channel).map(coefficient));
    }
    Ok(g)
}

/// How the vertices hang on a body.
fn binding(rows: &mut Rows<'_>, notes: &mut Vec<String>) -> Result<Binding, SceneError> {
    let joints = rows.numbered("joint_")?;
    if !joints.is_empty() {
        let weights = rows.numbered("weight_")?;
        if weights.len() != joints.len() {
            let problem = format!("{} properties", weights.len());
            return Err(SceneError::new("weight_*", problem, format!("{}, as joint_*", joints.len())));
        }
        for i in 0..rows.len() {
            joints.iter().try_for_each(|&j| rows.index(i, j, "joint").map(drop))?;
        }
        let rows = &*rows;
        let pair = |i, (&j, &w)| (rows.number(i, j) as usize, rows.value(i, w));
        let row = |i| joints.iter().zip(&weights).map(|columns| pair(i, columns)).collect();
        let mut table: Vec<Vec<(usize, f32)>> = (0..rows.len()).map(row).collect();
        notes.extend(SkinWeights::normalise(&mut table).map(|note| format!("weights: {note}")));
        let table = SkinWeights::from_rows(table, usize::from(u16::MAX) + 1)?;
        return Ok(Binding::Vertex(table));
    }
    if !rows.has("face") {
        return Ok(Binding::Static);
    }
    let [face, offset] = rows.columns(&["face", "offset"])?;
    let barycentric = rows.columns(&["bary_0", "bary_1", "bary_2"])?;
    let all = 0..rows.len();
    Ok(Binding::Face(FaceBinding {
        faces: all
            .clone()
            .map(|i| Ok(rows.index(i, face, "face")? as u32))
            .collect::<Result<_, SceneError>>()?,
        barycentric: all.clone().map(|i| barycentric.map(|c| rows.value(i, c))).collect(),
        offsets: all.map(|i| rows.value(i, offset)).collect(),
    }))
}
