//! The text at the start of a PLY file.
//!
//! Keywords and names are ASCII, comments are whatever somebody typed: bytes that are no UTF-8 become replacement
//! characters.

use skinsplat_core::scene::SceneError;
use std::collections::BTreeMap;

/// How values are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// `binary_little_endian`, what every viewer reads.
    #[default]
    LittleEndian,
    /// `binary_big_endian`; read, never written.
    BigEndian,
    /// Decimal text, one vertex per line.
    Ascii,
}

/// A number type of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A scalar property.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Bytes from the start of the row.
    pub(super) offset: usize,
}

/// What stands in a row with lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Field {
    /// A number.
    Scalar(Kind),
    /// A count, and so many numbers.
    List(Kind, Kind),
}

/// An element and its scalar properties.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
    /// Its rows field by field, if there are lists among them: they have no fixed length then.
    pub(super) lists: Option<Vec<Field>>,
    /// Where each name stands among the properties; `None` for one that is there twice.
    places: BTreeMap<String, Option<usize>>,
}

impl Element {
    /// Where the property of a name stands; `None` if there is none, `Some(None)` if there are several.
    pub(super) fn place(&self, name: &str) -> Option<Option<usize>> {
        self.places.get(name).copied()
    }

    /// How many properties are called `prefix0`, `prefix1` and so on, in whatever order.
    pub(super) fn numbered(&self, prefix: &str) -> usize {
        let is_numbered = |name: &str| name.strip_prefix(prefix).is_some_and(|k| k.parse::<u32>().is_ok());
        self.properties.iter().filter(|p| is_numbered(&p.name)).count()
    }

    fn push(&mut self, name: String, kind: Kind) {
        let (offset, place) = (self.stride(), self.properties.len());
        self.places.entry(name.clone()).and_modify(|place| *place = None).or_insert(Some(place));
        self.properties.push(Property { name, kind, offset });
        if let Some(fields) = &mut self.lists {
            fields.push(Field::Scalar(kind));
        }
    }

    fn push_list(&mut self, count: Kind, item: Kind) {
        let scalars = || self.properties.iter().map(|p| Field::Scalar(p.kind)).collect();
        let mut fields = self.lists.take().unwrap_or_else(scalars);
        fields.push(Field::List(count, item));
        self.lists = Some(fields);
    }

    /// Bytes per row.
    pub(super) fn stride(&self) -> usize {
        self.properties.last().map_or(0, |p| p.offset + p.kind.size())
    }
}

/// A parsed header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) comments: Vec<String>,
    /// Length of the header in bytes.
    pub(super) length: usize,
}

const MAX_LENGTH: usize = 1 << 20;
/// A splat of degree 3 has 62; tools add some.
const MAX_PROPERTIES: usize = 4096;
const MAX_ELEMENTS: usize = 64;

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, SceneError> {
        let mut header =
            Self { encoding: Encoding::LittleEndian, elements: Vec::new(), comments: Vec::new(), length: 0 };
        let mut format_seen = false;
        let lines = bytes[..bytes.len().min(MAX_LENGTH)].split_inclusive(|&b| b == b'\n');
        for (number, line) in lines.enumerate() {
            header.length += line.len();
            let text = String::from_utf8_lossy(line.trim_ascii());
            let mut words = text.split_ascii_whitespace();
            match (number, words.next()) {
                (0, Some("ply")) if words.next().is_none() => {}
                (0, _) => return Err(broken("no \"ply\" in the first line")),
                (_, None) => {}
                (_, Some("comment" | "obj_info")) => {
                    header.comments.push(text.split_once(' ').map_or("", |(_, rest)| rest.trim()).to_owned());
                }
                (_, Some("end_header")) if format_seen => return Ok(header),
                (_, Some("end_header")) => return Err(broken("no format line")),
                _ => {
                    let words: Vec<&str> = text.split_ascii_whitespace().collect();
                    format_seen |= words[0] == "format";
                    header.line(&words)?;
                }
            }
        }
        Err(broken("no end_header"))
    }

    /// A line that is neither a comment nor the first or the last.
    fn line(&mut self, words: &[&str]) -> Result<(), SceneError> {
        match words {
            ["format", name, _] => {
                self.encoding = match *name {
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    "ascii" => Encoding::Ascii,
                    other => {
                        let expected = "binary_little_endian, binary_big_endian or ascii";
                        return Err(SceneError::new("format", shown(other), expected));
                    }
                };
                Ok(())
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|e| {
                    let field = format!("element {}", shown(name));
                    SceneError::new(field, format!("{}: {e}", shown(count)), "a count")
                })?;
                if self.elements.len() == MAX_ELEMENTS {
                    return Err(broken(&format!("more than {MAX_ELEMENTS} elements")));
                }
                self.elements.push(Element { name: (*name).to_owned(), count, ..Element::default() });
                Ok(())
            }
            ["property", rest @ ..] => self.property(rest),
            _ => {
                let line = shown(&words.join(" "));
                Err(SceneError::new("header", format!("line {line:?}"), "a PLY header line"))
            }
        }
    }

    fn property(&mut self, words: &[&str]) -> Result<(), SceneError> {
        let line = || format!("property {}", shown(&words.join(" ")));
        let Some(element) = self.elements.last_mut() else {
            return Err(SceneError::new("header", line(), "an element before its properties"));
        };
        if element.lists.as_ref().map_or(element.properties.len(), Vec::len) == MAX_PROPERTIES {
            let field = format!("element {}", shown(&element.name));
            let expected = format!("at most {MAX_PROPERTIES}");
            return Err(SceneError::new(field, "more properties than any splat has", expected));
        }
        let number = |kind: &str| {
            let problem = || SceneError::new(line(), format!("type {}", shown(kind)), "a PLY number type");
            Kind::parse(kind).ok_or_else(problem)
        };
        match words {
            ["list", count, item, _] => element.push_list(number(count)?, number(item)?),
            [kind, name] => element.push((*name).to_owned(), number(kind)?),
            _ => return Err(SceneError::new("header", line(), "property TYPE NAME")),
        }
        Ok(())
    }
}

fn broken(problem: &str) -> SceneError {
    SceneError::new("header", problem, "a PLY header up to end_header")
}

/// Words of a file in a message: short, and without control characters.
fn shown(text: &str) -> String {
    const MOST: usize = 80;
    let more = if text.chars().nth(MOST).is_some() { "…" } else { "" };
    text.chars().take(MOST).map(|c| if c.is_control() { ' ' } else { c }).collect::<String>() + more
}
