//! Reading avatars.

use super::super::{Error, error};
use super::REST_COUNTS;
use super::header::{Element, Encoding, Header, Kind};
use glam::Vec3;
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, SceneError, SkinWeights};
use std::borrow::Cow;
use std::path::Path;

/// An avatar and what its file says about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// The avatar.
    pub avatar: Avatar,
    /// How values are stored.
    pub encoding: Encoding,
    /// The body model that the avatar was bound to, as the writer named it.
    pub body: Option<String>,
    /// Comments in the header.
    pub comments: Vec<String>,
    /// Vertex properties that were not read.
    pub ignored: Vec<String>,
}

/// Reads an avatar from a 3DGS PLY file, with its binding if the file holds one.
///
/// # Errors
/// As [`read`].
pub fn read_avatar(path: &Path) -> Result<Avatar, Error> {
    read(path).map(|stored| stored.avatar)
}

/// Reads an avatar and what else its file says: little-endian, big-endian or ascii; SH degree 0 to 3, as the number of
/// `f_rest` properties tells.
///
/// # Errors
/// A broken header, missing properties, a file shorter than its header says, values that [`Avatar::validate`] refuses.
pub fn read(path: &Path) -> Result<Stored, Error> {
    let bytes = error::read_bytes(path, "avatar", "a 3DGS PLY file")?;
    parse(&bytes).map_err(|e| Error::scene(path, e))
}

fn parse(bytes: &[u8]) -> Result<Stored, SceneError> {
    let header = Header::parse(bytes)?;
    let mut rows = Rows::vertices(&header, &bytes[header.length..])?;
    let gaussians = gaussians(&mut rows)?;
    let binding = binding(&mut rows)?;
    let avatar = Avatar { gaussians, binding };
    avatar.validate(None)?;
    let body =
        header.comments.iter().find_map(|c| c.strip_prefix(super::write::BODY_COMMENT)).map(str::to_owned);
    let ignored = rows.ignored();
    Ok(Stored { avatar, encoding: header.encoding, body, comments: header.comments, ignored })
}

fn gaussians(rows: &mut Rows) -> Result<Gaussians, SceneError> {
    let position = rows.columns(&["x", "y", "z"])?;
    let scale = rows.columns(&["scale_0", "scale_1", "scale_2"])?;
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
        g.log_scales.push(Vec3::from_array(scale.map(|c| rows.value(i, c))));
        g.opacity_logits.push(rows.value(i, opacity));
        g.sh.push(dc.map(|c| rows.value(i, c)));
        let coefficient = |k: usize| [0, 1, 2].map(|channel| rows.value(i, rest[channel * per_channel + k]));
        g.sh.extend((0..per_channel).map(coefficient));
    }
    Ok(g)
}

fn binding(rows: &mut Rows) -> Result<Binding, SceneError> {
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
        let pairs = joints.iter().zip(&weights);
        let row = |i| pairs.clone().map(move |(&j, &w)| (rows.number(i, j) as usize, rows.value(i, w)));
        let table = SkinWeights::from_rows((0..rows.len()).map(row), usize::from(u16::MAX) + 1)?;
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

/// A property of each row.
#[derive(Clone, Copy)]
struct Column {
    offset: usize,
    kind: Kind,
}

/// The vertices as rows of equal length.
struct Rows<'a> {
    bytes: Cow<'a, [u8]>,
    element: &'a Element,
    stride: usize,
    big_endian: bool,
    used: Vec<bool>,
}

impl<'a> Rows<'a> {
    fn vertices(header: &'a Header, mut body: &'a [u8]) -> Result<Self, SceneError> {
        let position = header.elements.iter().position(|e| e.name == "vertex");
        let Some(position) = position else {
            return Err(SceneError::new("element vertex", "missing", "one vertex per Gaussian"));
        };
        for element in &header.elements[..position] {
            body = skip(element, header.encoding, body)?;
        }
        let element = &header.elements[position];
        if element.has_lists || element.properties.is_empty() || element.count == 0 {
            let problem = format!("{} rows of {} numbers", element.count, element.properties.len());
            let expected = "at least one row of numbers, without lists";
            return Err(SceneError::new("element vertex", problem, expected));
        }
        let bytes = match header.encoding {
            Encoding::Ascii => Cow::Owned(from_text(element, body)?),
            _ => Cow::Borrowed(fixed_rows(element, body)?),
        };
        let used = vec![false; element.properties.len()];
        Ok(Self {
            bytes,
            element,
            stride: element.stride(),
            big_endian: header.encoding == Encoding::BigEndian,
            used,
        })
    }

    fn len(&self) -> usize {
        self.element.count
    }

    fn has(&self, name: &str) -> bool {
        self.element.properties.iter().any(|p| p.name == name)
    }

    fn column(&mut self, name: &str) -> Result<Column, SceneError> {
        let mut found = (0..self.used.len()).filter(|&i| self.element.properties[i].name == name);
        match (found.next(), found.next()) {
            (Some(i), None) => {
                self.used[i] = true;
                let property = &self.element.properties[i];
                Ok(Column { offset: property.offset, kind: property.kind })
            }
            (None, _) => Err(SceneError::new(name, "missing", "a vertex property of that name")),
            _ => Err(SceneError::new(name, "there twice", "one property of that name")),
        }
    }

    fn columns<const N: usize>(&mut self, names: &[&str; N]) -> Result<[Column; N], SceneError> {
        let mut columns = [Column { offset: 0, kind: Kind::F32 }; N];
        for (column, name) in columns.iter_mut().zip(names) {
            *column = self.column(name)?;
        }
        Ok(columns)
    }

    /// The columns `prefix0`, `prefix1`, …
    fn numbered(&mut self, prefix: &str) -> Result<Vec<Column>, SceneError> {
        let is_numbered = |name: &str| name.strip_prefix(prefix).is_some_and(|k| k.parse::<u32>().is_ok());
        let count = self.element.properties.iter().filter(|p| is_numbered(&p.name)).count();
        (0..count).map(|k| self.column(&format!("{prefix}{k}"))).collect()
    }

    fn ignored(&self) -> Vec<String> {
        let unused = self.element.properties.iter().zip(&self.used).filter(|(_, used)| !**used);
        unused
            .map(|(p, _)| p.name.clone())
            .filter(|name| !["nx", "ny", "nz"].contains(&name.as_str()))
            .collect()
    }

    fn value(&self, row: usize, column: Column) -> f32 {
        match column.kind {
            Kind::F32 => f32::from_le_bytes(self.ordered(&self.bytes[row * self.stride + column.offset..])),
            _ => self.number(row, column) as f32,
        }
    }

    fn index(&self, row: usize, column: Column, name: &str) -> Result<usize, SceneError> {
        let number = self.number(row, column);
        if number >= 0.0 && number <= f64::from(u32::MAX) && number.fract() == 0.0 {
            return Ok(number as usize);
        }
        Err(SceneError::new(format!("{name}[{row}]"), format!("{number}"), "an index"))
    }

    fn number(&self, row: usize, column: Column) -> f64 {
        let bytes = &self.bytes[row * self.stride + column.offset..];
        match column.kind {
            Kind::I8 => f64::from(bytes[0] as i8),
            Kind::U8 => f64::from(bytes[0]),
            Kind::I16 => f64::from(i16::from_le_bytes(self.ordered(bytes))),
            Kind::U16 => f64::from(u16::from_le_bytes(self.ordered(bytes))),
            Kind::I32 => f64::from(i32::from_le_bytes(self.ordered(bytes))),
            Kind::U32 => f64::from(u32::from_le_bytes(self.ordered(bytes))),
            Kind::F32 => f64::from(f32::from_le_bytes(self.ordered(bytes))),
            Kind::F64 => f64::from_le_bytes(self.ordered(bytes)),
        }
    }

    fn ordered<const N: usize>(&self, bytes: &[u8]) -> [u8; N] {
        let mut array = [0; N];
        array.copy_from_slice(&bytes[..N]);
        if self.big_endian {
            array.reverse();
        }
        array
    }
}

/// The bytes of an element's rows, if they are all there.
fn fixed_rows<'a>(element: &Element, body: &'a [u8]) -> Result<&'a [u8], SceneError> {
    let size = element.count.checked_mul(element.stride());
    size.and_then(|size| body.get(..size)).ok_or_else(|| truncated(element, body.len()))
}

fn truncated(element: &Element, found: usize) -> SceneError {
    let problem = format!("truncated, {found} bytes after the header");
    let expected = format!("{} rows of {} values", element.count, element.properties.len());
    SceneError::new(format!("element {}", element.name), problem, expected)
}

fn skip<'a>(element: &Element, encoding: Encoding, body: &'a [u8]) -> Result<&'a [u8], SceneError> {
    if encoding == Encoding::Ascii {
        let mut rest = body;
        for _ in 0..element.count {
            let end = rest.iter().position(|&b| b == b'\n').ok_or_else(|| truncated(element, body.len()))?;
            rest = &rest[end + 1..];
        }
        return Ok(rest);
    }
    if element.has_lists {
        let field = format!("element {}", element.name);
        return Err(SceneError::new(field, "lists before the vertices", "vertices first"));
    }
    fixed_rows(element, body).map(|rows| &body[rows.len()..])
}

/// Ascii rows as the little-endian bytes that their types declare.
fn from_text(element: &Element, body: &[u8]) -> Result<Vec<u8>, SceneError> {
    // Every value takes at least one digit and one separator.
    let least = element.count.checked_mul(element.properties.len()).and_then(|n| n.checked_mul(2));
    if least.is_none_or(|least| least > body.len() + 1) {
        return Err(truncated(element, body.len()));
    }
    let mut words = body.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let mut bytes = Vec::with_capacity(element.count * element.stride());
    for row in 0..element.count {
        for property in &element.properties {
            let word = words.next().ok_or_else(|| truncated(element, body.len()))?;
            let parsed =
                std::str::from_utf8(word).ok().and_then(|text| push(&mut bytes, property.kind, text));
            if parsed.is_none() {
                let problem = format!("{:?}", String::from_utf8_lossy(word));
                let expected = format!("a number of type {:?}", property.kind).to_lowercase();
                return Err(SceneError::new(format!("{}[{row}]", property.name), problem, expected));
            }
        }
    }
    Ok(bytes)
}

fn push(bytes: &mut Vec<u8>, kind: Kind, text: &str) -> Option<()> {
    match kind {
        Kind::I8 => bytes.extend(text.parse::<i8>().ok()?.to_le_bytes()),
        Kind::U8 => bytes.extend(text.parse::<u8>().ok()?.to_le_bytes()),
        Kind::I16 => bytes.extend(text.parse::<i16>().ok()?.to_le_bytes()),
        Kind::U16 => bytes.extend(text.parse::<u16>().ok()?.to_le_bytes()),
        Kind::I32 => bytes.extend(text.parse::<i32>().ok()?.to_le_bytes()),
        Kind::U32 => bytes.extend(text.parse::<u32>().ok()?.to_le_bytes()),
        Kind::F32 => bytes.extend(text.parse::<f32>().ok()?.to_le_bytes()),
        Kind::F64 => bytes.extend(text.parse::<f64>().ok()?.to_le_bytes()),
    }
    Some(())
}
