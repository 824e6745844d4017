//! The rows of an element as columns of numbers.

use super::header::{Element, Encoding, Field, Header, Kind};
use skinsplat_core::scene::SceneError;
use std::borrow::Cow;

/// A property of each row.
#[derive(Clone, Copy)]
pub(super) struct Column {
    offset: usize,
    kind: Kind,
}

/// The rows of an element, of equal length.
pub(super) struct Rows<'a> {
    bytes: Cow<'a, [u8]>,
    element: &'a Element,
    stride: usize,
    big_endian: bool,
    used: Vec<bool>,
}

impl<'a> Rows<'a> {
    /// The rows of the element of that name; `body` is what follows the header. `None` if there is no such element.
    pub(super) fn of(header: &'a Header, name: &str, mut body: &'a [u8]) -> Result<Option<Self>, SceneError> {
        let Some(position) = header.elements.iter().position(|e| e.name == name) else { return Ok(None) };
        for element in &header.elements[..position] {
            body = skip(element, header.encoding, body)?;
        }
        let element = &header.elements[position];
        if element.lists.is_some() || element.properties.is_empty() || element.count == 0 {
            let problem = format!("{} rows of {} numbers", element.count, element.properties.len());
            let expected = "at least one row of numbers, without lists";
            return Err(SceneError::new(format!("element {name}"), problem, expected));
        }
        let bytes = match header.encoding {
            Encoding::Ascii => Cow::Owned(from_text(element, body)?),
            _ => Cow::Borrowed(fixed_rows(element, body)?),
        };
        let used = vec![false; element.properties.len()];
        let big_endian = header.encoding == Encoding::BigEndian;
        Ok(Some(Self { bytes, element, stride: element.stride(), big_endian, used }))
    }

    pub(super) fn len(&self) -> usize {
        self.element.count
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.element.place(name).is_some()
    }

    pub(super) fn column(&mut self, name: &str) -> Result<Column, SceneError> {
        match self.element.place(name) {
            Some(Some(i)) => {
                self.used[i] = true;
                let property = &self.element.properties[i];
                Ok(Column { offset: property.offset, kind: property.kind })
            }
            None => {
                let expected = format!("a property of that name of each {}", self.element.name);
                Err(SceneError::new(name, "missing", expected))
            }
            Some(None) => Err(SceneError::new(name, "there twice", "one property of that name")),
        }
    }

    pub(super) fn columns<const N: usize>(&mut self, names: &[&str; N]) -> Result<[Column; N], SceneError> {
        let mut columns = [Column { offset: 0, kind: Kind::F32 }; N];
        for (column, name) in columns.iter_mut().zip(names) {
            *column = self.column(name)?;
        }
        Ok(columns)
    }

    /// The columns `prefix0`, `prefix1`, …
    pub(super) fn numbered(&mut self, prefix: &str) -> Result<Vec<Column>, SceneError> {
        (0..self.element.numbered(prefix)).map(|k| self.column(&format!("{prefix}{k}"))).collect()
    }

    /// The names of the columns that nobody asked for, normals left out.
    pub(super) fn ignored(&self) -> Vec<String> {
        let unused = self.element.properties.iter().zip(&self.used).filter(|(_, used)| !**used);
        unused
            .map(|(p, _)| p.name.clone())
            .filter(|name| !["nx", "ny", "nz"].contains(&name.as_str()))
            .collect()
    }

    pub(super) fn value(&self, row: usize, column: Column) -> f32 {
        match column.kind {
            Kind::F32 => f32::from_le_bytes(ordered(self.at(row, column), self.big_endian)),
            _ => self.number(row, column) as f32,
        }
    }

    /// The bits of a `uint`.
    pub(super) fn bits(&self, row: usize, column: Column) -> Result<u32, SceneError> {
        match column.kind {
            Kind::U32 | Kind::I32 => Ok(u32::from_le_bytes(ordered(self.at(row, column), self.big_endian))),
            _ => Err(SceneError::new("packed_*", "another type of number", "property uint")),
        }
    }

    pub(super) fn index(&self, row: usize, column: Column, name: &str) -> Result<usize, SceneError> {
        let number = self.number(row, column);
        if number >= 0.0 && number <= f64::from(u32::MAX) && number.fract() == 0.0 {
            return Ok(number as usize);
        }
        Err(SceneError::new(format!("{name}[{row}]"), format!("{number}"), "an index"))
    }

    pub(super) fn number(&self, row: usize, column: Column) -> f64 {
        number(column.kind, self.at(row, column), self.big_endian)
    }

    fn at(&self, row: usize, column: Column) -> &[u8] {
        &self.bytes[row * self.stride + column.offset..]
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
    if let Some(fields) = &element.lists {
        return skip_lists(element, fields, encoding, body);
    }
    fixed_rows(element, body).map(|rows| &body[rows.len()..])
}

/// Binary rows with lists among their fields. Every row takes at least a byte, so the walk ends with the file.
fn skip_lists<'a>(
    element: &Element,
    fields: &[Field],
    encoding: Encoding,
    body: &'a [u8],
) -> Result<&'a [u8], SceneError> {
    let mut rest = body;
    let mut take = |size: usize| {
        let (taken, left) = rest.split_at_checked(size).ok_or_else(|| truncated(element, body.len()))?;
        rest = left;
        Ok::<&'a [u8], SceneError>(taken)
    };
    for _ in 0..element.count {
        for field in fields {
            match *field {
                Field::Scalar(kind) => {
                    take(kind.size())?;
                }
                Field::List(count, item) => {
                    let number = number(count, take(count.size())?, encoding == Encoding::BigEndian);
                    // `as` turns what is negative into 0 and what is too large into more than any file holds
                    let size = (number as usize).checked_mul(item.size());
                    take(size.unwrap_or(usize::MAX))?;
                }
            }
        }
    }
    Ok(rest)
}

/// The number at the start of some bytes.
fn number(kind: Kind, bytes: &[u8], big_endian: bool) -> f64 {
    match kind {
        Kind::I8 => f64::from(bytes[0] as i8),
        Kind::U8 => f64::from(bytes[0]),
        Kind::I16 => f64::from(i16::from_le_bytes(ordered(bytes, big_endian))),
        Kind::U16 => f64::from(u16::from_le_bytes(ordered(bytes, big_endian))),
        Kind::I32 => f64::from(i32::from_le_bytes(ordered(bytes, big_endian))),
        Kind::U32 => f64::from(u32::from_le_bytes(ordered(bytes, big_endian))),
        Kind::F32 => f64::from(f32::from_le_bytes(ordered(bytes, big_endian))),
        Kind::F64 => f64::from_le_bytes(ordered(bytes, big_endian)),
    }
}

/// The first bytes in little-endian order.
fn ordered<const N: usize>(bytes: &[u8], big_endian: bool) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&bytes[..N]);
    if big_endian {
        array.reverse();
    }
    array
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
