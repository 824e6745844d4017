//! Writing avatars.

use super::super::{Error, atomic};
use super::header::Encoding;
use skinsplat_core::scene::{Avatar, Binding};
use std::io::{self, Write};
use std::path::Path;

/// What a file says about its avatar besides the numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// The body model that it is bound to.
    pub body: Option<String>,
    /// Further comments, one line each ("posed by quaternion-average").
    pub comments: Vec<String>,
}

pub(super) const BODY_COMMENT: &str = "skinsplat body ";
const BINDING_COMMENT: &str = "skinsplat binding ";

/// Writes an avatar as a 3DGS PLY file. Reading it back gives the same bits, in either encoding; a static avatar is a
/// plain 3DGS file without further properties.
///
/// # Errors
/// An avatar that [`Avatar::validate`] refuses, a big-endian encoding, or a file that cannot be written.
pub fn write_avatar(
    path: &Path,
    avatar: &Avatar,
    metadata: &Metadata,
    encoding: Encoding,
) -> Result<(), Error> {
    avatar.validate(None).map_err(|e| Error::scene(path, e))?;
    if encoding == Encoding::BigEndian {
        return Err(Error::invalid(path, "format", "big-endian", "little-endian or ascii"));
    }
    atomic::write(path, |w| {
        w.write_all(header(avatar, metadata, encoding).as_bytes())?;
        let influences = influences(avatar);
        let mut row = Vec::new();
        for i in 0..avatar.gaussians.len() {
            row.clear();
            fill_row(&mut row, avatar, influences, i);
            match encoding {
                Encoding::Ascii => write_line(w, &row)?,
                _ => row.iter().try_for_each(|value| w.write_all(&value.to_le_bytes()))?,
            }
        }
        Ok(())
    })
}

/// A value of a row; every property is four bytes wide.
#[derive(Clone, Copy)]
enum Value {
    Float(f32),
    Index(u32),
}

impl Value {
    fn to_le_bytes(self) -> [u8; 4] {
        match self {
            Self::Float(v) => v.to_le_bytes(),
            Self::Index(v) => v.to_le_bytes(),
        }
    }
}

fn write_line(w: &mut impl Write, row: &[Value]) -> io::Result<()> {
    for (k, value) in row.iter().enumerate() {
        let separator = if k + 1 == row.len() { "\n" } else { " " };
        match value {
            // The shortest decimal that reads back as the same float.
            Value::Float(v) => write!(w, "{v}{separator}")?,
            Value::Index(v) => write!(w, "{v}{separator}")?,
        }
    }
    Ok(())
}

fn header(avatar: &Avatar, metadata: &Metadata, encoding: Encoding) -> String {
    let format = if encoding == Encoding::Ascii { "ascii" } else { "binary_little_endian" };
    let mut lines = vec!["ply".to_owned(), format!("format {format} 1.0")];
    lines.push(format!("element vertex {}", avatar.gaussians.len()));
    let mut property = |kind: &str, name: &str| lines.push(format!("property {kind} {name}"));
    let numbered =
        |prefix: &str, count: usize| (0..count).map(|k| format!("{prefix}_{k}")).collect::<Vec<_>>();
    ["x", "y", "z", "nx", "ny", "nz"].iter().for_each(|name| property("float", name));
    numbered("f_dc", 3).iter().for_each(|name| property("float", name));
    numbered("f_rest", 3 * (avatar.gaussians.sh_count() - 1)).iter().for_each(|name| property("float", name));
    property("float", "opacity");
    numbered("scale", 3).iter().for_each(|name| property("float", name));
    numbered("rot", 4).iter().for_each(|name| property("float", name));
    let binding = match &avatar.binding {
        Binding::Static => "none",
        Binding::Vertex(_) => {
            numbered("joint", influences(avatar)).iter().for_each(|name| property("uint", name));
            numbered("weight", influences(avatar)).iter().for_each(|name| property("float", name));
            "vertex"
        }
        Binding::Face(_) => {
            property("uint", "face");
            numbered("bary", 3).iter().for_each(|name| property("float", name));
            property("float", "offset");
            "face"
        }
    };
    let body = metadata.body.iter().map(|body| format!("{BODY_COMMENT}{body}"));
    let comments =
        std::iter::once(format!("{BINDING_COMMENT}{binding}")).chain(body).chain(metadata.comments.clone());
    let one_line = |text: String| text.replace(char::is_control, " ");
    lines.extend(comments.map(|text| format!("comment {}", one_line(text))));
    lines.push("end_header\n".to_owned());
    lines.join("\n")
}

/// Joints per row of a vertex binding.
fn influences(avatar: &Avatar) -> usize {
    match &avatar.binding {
        Binding::Vertex(weights) => weights.max_influences(),
        _ => 0,
    }
}

fn fill_row(row: &mut Vec<Value>, avatar: &Avatar, influences: usize, i: usize) {
    let g = &avatar.gaussians;
    let sh = &g.sh[i * g.sh_count()..(i + 1) * g.sh_count()];
    let floats = |row: &mut Vec<Value>, values: &[f32]| row.extend(values.iter().map(|&v| Value::Float(v)));
    floats(row, &g.means[i].to_array());
    floats(row, &[0.0; 3]);
    floats(row, &sh[0]);
    for channel in 0..3 {
        row.extend(sh[1..].iter().map(|rgb| Value::Float(rgb[channel])));
    }
    floats(row, &[g.opacity_logits[i]]);
    floats(row, &g.log_scales[i].to_array());
    floats(row, &g.rotations[i]);
    match &avatar.binding {
        Binding::Static => {}
        Binding::Vertex(weights) => {
            let (joints, values) = weights.row(i);
            let padding = influences - joints.len();
            row.extend(joints.iter().map(|&j| Value::Index(u32::from(j))));
            row.extend(std::iter::repeat_n(Value::Index(0), padding));
            floats(row, values);
            row.extend(std::iter::repeat_n(Value::Float(0.0), padding));
        }
        Binding::Face(binding) => {
            row.push(Value::Index(binding.faces[i]));
            floats(row, &binding.barycentric[i]);
            floats(row, &[binding.offsets[i]]);
        }
    }
}
