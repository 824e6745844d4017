//! What needs are told in: angles, extremes over a motion, bounds.

use super::super::RotationChoice;
use std::fmt;

/// A value and the pose in which it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Extreme {
    /// Degrees, or a gap in \[0, 1\].
    pub value: f64,
    /// Index of the pose.
    pub pose: usize,
}

/// How far a rotation choice can be from the exact average.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Bound {
    /// The choice.
    pub rotation: RotationChoice,
    /// At least the largest angle, rounding to `f32` allowed for.
    pub degrees: Degrees,
    /// The part that is proved: in exact arithmetic.
    pub proved: Degrees,
}

/// An angle in degrees; infinite (`null` in JSON) where nothing is proved.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Degrees(pub f64);

#[cfg(feature = "serde")]
impl serde::Serialize for Degrees {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() { serializer.serialize_f64(self.0) } else { serializer.serialize_none() }
    }
}

impl fmt::Display for Degrees {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            angle if !angle.is_finite() => f.write_str("no bound"),
            angle if angle < 0.01 => write!(f, "{angle:.1e}°"),
            angle => write!(f, "{angle:.3}°"),
        }
    }
}
