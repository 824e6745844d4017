//! The text at the start of a PLY file.

use skinsplat_core::scene::SceneError;

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

/// An element and its scalar properties.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
    /// Rows have no fixed length.
    pub(super) has_lists: bool,
}

impl Element {
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

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, SceneError> {
        let broken = |problem: &str| SceneError::new("header", problem, "a PLY header up to end_header");
        let mut header =
            Self { encoding: Encoding::LittleEndian, elements: Vec::new(), comments: Vec::new(), length: 0 };
        let mut format_seen = false;
        for (number, line) in
            bytes[..bytes.len().min(MAX_LENGTH)].split_inclusive(|&b| b == b'\n').enumerate()
        {
            header.length += line.len();
            let text = std::str::from_utf8(line.trim_ascii()).map_err(|e| broken(&e.to_string()))?;
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            match (number, &words[..]) {
                (0, ["ply"]) => {}
                (0, _) => return Err(broken("no \"ply\" in the first line")),
                (_, ["format", name, _]) => {
                    format_seen = true;
                    header.encoding = match *name {
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        "ascii" => Encoding::Ascii,
                        other => {
                            let expected = "binary_little_endian, binary_big_endian or ascii";
                            return Err(SceneError::new("format", other, expected));
                        }
                    };
                }
                (_, ["comment" | "obj_info", ..]) => {
                    header.comments.push(text.split_once(' ').map_or("", |(_, rest)| rest.trim()).to_owned());
                }
                (_, ["element", name, count]) => {
                    let count = count.parse().map_err(|e| {
                        SceneError::new(format!("element {name}"), format!("{count}: {e}"), "a count")
                    })?;
                    header.elements.push(Element { name: (*name).to_owned(), count, ..Element::default() });
                }
                (_, ["property", rest @ ..]) => header.property(rest)?,
                (_, ["end_header"]) if format_seen => return Ok(header),
                (_, ["end_header"]) => return Err(broken("no format line")),
                (_, []) => {}
                _ => return Err(SceneError::new("header", format!("line {text:?}"), "a PLY header line")),
            }
        }
        Err(broken("no end_header"))
    }

    fn property(&mut self, words: &[&str]) -> Result<(), SceneError> {
        let line = || format!("property {}", words.join(" "));
        let Some(element) = self.elements.last_mut() else {
            return Err(SceneError::new("header", line(), "an element before its properties"));
        };
        match words {
            ["list", _, _, _] => element.has_lists = true,
            [kind, name] => {
                let kind = Kind::parse(kind)
                    .ok_or_else(|| SceneError::new(line(), format!("type {kind}"), "a PLY number type"))?;
                let offset = element.stride();
                element.properties.push(Property { name: (*name).to_owned(), kind, offset });
            }
            _ => return Err(SceneError::new("header", line(), "property TYPE NAME")),
        }
        Ok(())
    }
}
