//! Types of the numbers in storages.

/// The type of a storage's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    F64,
    F32,
    F16,
    BF16,
    I64,
    I32,
    I16,
    I8,
    U8,
    Bool,
}

impl Element {
    /// By the name of torch's class of storages.
    pub(super) fn named(storage: &str) -> Option<Self> {
        Some(match storage {
            "DoubleStorage" => Self::F64,
            "FloatStorage" => Self::F32,
            "HalfStorage" => Self::F16,
            "BFloat16Storage" => Self::BF16,
            "LongStorage" => Self::I64,
            "IntStorage" => Self::I32,
            "ShortStorage" => Self::I16,
            "CharStorage" => Self::I8,
            "ByteStorage" => Self::U8,
            "BoolStorage" => Self::Bool,
            _ => return None,
        })
    }

    /// Bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::F64 | Self::I64 => 8,
            Self::F32 | Self::I32 => 4,
            Self::F16 | Self::BF16 | Self::I16 => 2,
            Self::I8 | Self::U8 | Self::Bool => 1,
        }
    }

    /// The number at the start of some bytes.
    pub(super) fn value(self, bytes: &[u8], big_endian: bool) -> f64 {
        match self {
            Self::F64 => f64::from_le_bytes(ordered(bytes, big_endian)),
            Self::F32 => f32::from_le_bytes(ordered(bytes, big_endian)).into(),
            Self::F16 => half::f16::from_le_bytes(ordered(bytes, big_endian)).into(),
            Self::BF16 => half::bf16::from_le_bytes(ordered(bytes, big_endian)).into(),
            Self::I64 => i64::from_le_bytes(ordered(bytes, big_endian)) as f64,
            Self::I32 => i32::from_le_bytes(ordered(bytes, big_endian)).into(),
            Self::I16 => i16::from_le_bytes(ordered(bytes, big_endian)).into(),
            Self::I8 => f64::from(bytes[0] as i8),
            Self::U8 | Self::Bool => bytes[0].into(),
        }
    }
}

fn ordered<const N: usize>(bytes: &[u8], big_endian: bool) -> [u8; N] {
    let mut array: [u8; N] = std::array::from_fn(|i| bytes[i]);
    if big_endian {
        array.reverse();
    }
    array
}
