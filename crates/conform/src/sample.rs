//! What is compared: the numbers of one Gaussian in one pose, by field.

use serde::Serialize;
use std::ops::Range;

/// A part of an engine's answer that is judged on its own. SH are four of them, a band each, so that a bug in one band
/// is named by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Field {
    /// World positions: 3 numbers.
    Means,
    /// Posed unit quaternions: 4.
    Quaternions,
    /// Standard deviations along the axes of the quaternion: 3.
    Scales,
    /// xx, xy, xz, yy, yz, zz.
    Covariances,
    /// The unit direction from the camera to the mean, turned back into the canonical frame: 3.
    Directions,
    /// Opacity: 1.
    Opacities,
    /// SH of degree 0: 3.
    Sh0,
    /// SH of degree 1: 9, coefficient by coefficient, R G B each.
    Sh1,
    /// SH of degree 2: 15.
    Sh2,
    /// SH of degree 3: 21.
    Sh3,
}

/// Numbers of one Gaussian in one pose.
pub(crate) const WIDTH: usize = 68;

/// The numbers of one Gaussian in one pose, field after field.
pub(crate) type Sample = [f64; WIDTH];

impl Field {
    /// Every field, in the order of a sample.
    pub const ALL: [Self; 10] = [
        Self::Means,
        Self::Quaternions,
        Self::Scales,
        Self::Covariances,
        Self::Directions,
        Self::Opacities,
        Self::Sh0,
        Self::Sh1,
        Self::Sh2,
        Self::Sh3,
    ];

    /// The bands of the SH.
    pub const SH: [Self; 4] = [Self::Sh0, Self::Sh1, Self::Sh2, Self::Sh3];

    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::Quaternions => "quaternions",
            Self::Scales => "scales",
            Self::Covariances => "covariances",
            Self::Directions => "directions",
            Self::Opacities => "opacities",
            Self::Sh0 => "sh band 0",
            Self::Sh1 => "sh band 1",
            Self::Sh2 => "sh band 2",
            Self::Sh3 => "sh band 3",
        }
    }

    /// Numbers per Gaussian.
    pub fn width(self) -> usize {
        range(self).len()
    }
}

/// Where a field lies in a sample.
pub(crate) fn range(field: Field) -> Range<usize> {
    match field {
        Field::Means => 0..3,
        Field::Quaternions => 3..7,
        Field::Scales => 7..10,
        Field::Covariances => 10..16,
        Field::Directions => 16..19,
        Field::Opacities => 19..20,
        Field::Sh0 => 20..23,
        Field::Sh1 => 23..32,
        Field::Sh2 => 32..47,
        Field::Sh3 => 47..68,
    }
}

/// A set of fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Fields(u16);

impl Fields {
    pub(crate) fn insert(&mut self, field: Field) {
        self.0 |= 1 << field as u16;
    }

    pub(crate) fn remove(&mut self, field: Field) {
        self.0 &= !(1 << field as u16);
    }

    pub(crate) fn contains(self, field: Field) -> bool {
        self.0 & (1 << field as u16) != 0
    }

    pub(crate) fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub(crate) fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub(crate) fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    pub(crate) fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    pub(crate) fn iter(self) -> impl Iterator<Item = Field> {
        Field::ALL.into_iter().filter(move |&field| self.contains(field))
    }
}

impl FromIterator<Field> for Fields {
    fn from_iter<T: IntoIterator<Item = Field>>(fields: T) -> Self {
        let mut set = Self::default();
        fields.into_iter().for_each(|field| set.insert(field));
        set
    }
}

/// How numbers of a file are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// Standard deviations and opacities as they are drawn: JSON and flat binary.
    Activated,
    /// Their logarithms and logits: a PLY of 3DGS.
    Logarithms,
}

/// How far the numbers of a field are from the expected ones: what is compared with the tolerance. `units` per metre.
///
/// Means in metres; scales and covariances relative to the Gaussian's size; quaternions up to their sign; directions,
/// opacities and SH as they are. NaN is infinitely far.
pub(crate) fn error(field: Field, storage: Storage, units: f64, expected: &[f64], found: &[f64]) -> f64 {
    let furthest = |sign: f64| {
        let difference = |(e, f): (&f64, &f64)| {
            let d = (e - sign * f).abs();
            if d.is_nan() { f64::INFINITY } else { d }
        };
        expected.iter().zip(found).map(difference).fold(0.0, f64::max)
    };
    let size = |values: &[f64]| values.iter().fold(f64::MIN_POSITIVE, |m: f64, v| m.max(v.abs()));
    match (field, storage) {
        (Field::Means, _) => furthest(1.0) / units,
        (Field::Quaternions, _) => furthest(1.0).min(furthest(-1.0)),
        (Field::Scales, Storage::Activated) | (Field::Covariances, _) => furthest(1.0) / size(expected),
        _ => furthest(1.0),
    }
}
