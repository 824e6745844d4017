//! Axes, units and the order of numbers, as engines have them.

use super::sample::{Sample, range};
use super::{Error, Field};
use skinsplat_core::math::{Matrix3, matrix3, rotation, sh};

/// How a file orders the components of a quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuaternionOrder {
    /// w first.
    Wxyz,
    /// w last.
    Xyzw,
}

/// How a file orders the entries of a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatrixOrder {
    /// Row by row; matrices act on column vectors.
    Row,
    /// Column by column (the same as row by row of the transpose, for row vectors).
    Column,
}

/// The numbers of a file: which axes, which unit, which order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convention {
    /// Its name.
    pub name: &'static str,
    /// What its axes are, for people.
    pub axes: &'static str,
    /// Rows of M: x' = M x for x in this project's axes (y up, right-handed). A signed permutation.
    pub map: Matrix3<f64>,
    /// Units per metre.
    pub units: f64,
    /// Order of quaternions.
    pub quaternions: QuaternionOrder,
    /// Order of matrices.
    pub matrices: MatrixOrder,
}

const SAME: Matrix3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Every convention; the first is this project's own and the default.
pub const CONVENTIONS: [Convention; 5] = [
    Convention {
        name: "skinsplat",
        axes: "right-handed, y up, x to the figure's left, z forward, metres",
        map: SAME,
        units: 1.0,
        quaternions: QuaternionOrder::Wxyz,
        matrices: MatrixOrder::Row,
    },
    Convention {
        name: "gltf",
        axes: "right-handed, y up, x to the figure's left, z forward, metres (as skinsplat)",
        map: SAME,
        units: 1.0,
        quaternions: QuaternionOrder::Xyzw,
        matrices: MatrixOrder::Column,
    },
    Convention {
        name: "unity",
        axes: "left-handed, y up, x to the figure's right, z forward, metres: (-x, y, z)",
        map: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        units: 1.0,
        quaternions: QuaternionOrder::Xyzw,
        matrices: MatrixOrder::Column,
    },
    Convention {
        name: "unreal",
        axes: "left-handed, z up, x to the figure's left, y forward, centimetres: 100 (x, z, y)",
        map: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        units: 100.0,
        quaternions: QuaternionOrder::Xyzw,
        matrices: MatrixOrder::Row,
    },
    Convention {
        name: "opencv",
        axes: "right-handed, y down, z backward, metres: (x, -y, -z)",
        map: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        units: 1.0,
        quaternions: QuaternionOrder::Wxyz,
        matrices: MatrixOrder::Row,
    },
];

impl Default for Convention {
    fn default() -> Self {
        CONVENTIONS[0]
    }
}

impl std::str::FromStr for Convention {
    type Err = Error;

    /// A name, perhaps with other orders: `unity`, `gltf,wxyz`, `unreal,xyzw,column`.
    fn from_str(text: &str) -> Result<Self, Error> {
        let unknown = |part: &str| {
            let names = CONVENTIONS.map(|convention| convention.name).join(", ");
            let expected = format!("one of {names}, perhaps with wxyz or xyzw, row or column (`unity,wxyz`)");
            Error::new("--convention", format!("`{part}`"), expected)
        };
        let mut parts = text.split(',').map(str::trim);
        let first = parts.next().unwrap_or_default();
        let named = |name: &str| CONVENTIONS.into_iter().find(|convention| convention.name == name);
        let mut orders: Vec<&str> = parts.collect();
        let mut convention = match named(first) {
            Some(convention) => convention,
            None => {
                orders.insert(0, first);
                Self::default()
            }
        };
        for part in orders {
            match part {
                "wxyz" => convention.quaternions = QuaternionOrder::Wxyz,
                "xyzw" => convention.quaternions = QuaternionOrder::Xyzw,
                "row" => convention.matrices = MatrixOrder::Row,
                "column" => convention.matrices = MatrixOrder::Column,
                other => return Err(unknown(other)),
            }
        }
        Ok(convention)
    }
}

impl std::fmt::Display for Convention {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{},{},{}", self.name, self.quaternions.name(), self.matrices.name())
    }
}

impl QuaternionOrder {
    /// `wxyz` or `xyzw`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wxyz => "wxyz",
            Self::Xyzw => "xyzw",
        }
    }

    /// A quaternion (w, x, y, z) as the file has it.
    pub fn ordered(self, [w, x, y, z]: [f64; 4]) -> [f64; 4] {
        match self {
            Self::Wxyz => [w, x, y, z],
            Self::Xyzw => [x, y, z, w],
        }
    }
}

impl MatrixOrder {
    /// `row` or `column`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Row => "row",
            Self::Column => "column",
        }
    }

    /// A matrix, given by rows, as the file has it.
    pub fn ordered(self, rows: [[f64; 4]; 4]) -> [f64; 16] {
        std::array::from_fn(|k| match self {
            Self::Row => rows[k / 4][k % 4],
            Self::Column => rows[k % 4][k / 4],
        })
    }
}

impl Convention {
    /// A point, in the units of the convention.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        matrix3::apply(self.map, p).map(|c| c * self.units)
    }

    /// A rotation (w, x, y, z) of these axes: the rotation M R Mᵀ, in the order (w, x, y, z).
    pub fn rotation(&self, q: [f64; 4]) -> [f64; 4] {
        turned_quaternion(&self.map, q)
    }

    /// Such a rotation, back in this project's axes.
    pub(crate) fn rotation_back(&self, q: [f64; 4]) -> [f64; 4] {
        turned_quaternion(&matrix3::transpose(self.map), q)
    }

    /// What one of this project's axes is called here.
    pub(crate) fn axis_name(&self, axis: usize) -> &'static str {
        let named = ["x", "y", "z"].into_iter().zip(self.map).find(|(_, row)| row[axis] != 0.0);
        named.map_or("", |(name, _)| name)
    }

    /// A signed permutation of this project's axes as it is seen here: `(x, -z, y)`.
    pub(crate) fn shown(&self, turn: &Matrix3<f64>) -> String {
        let seen = matrix3::multiply(matrix3::multiply(self.map, *turn), matrix3::transpose(self.map));
        let entry = |row: [f64; 3]| {
            let named = ["x", "y", "z"].into_iter().zip(row).find(|(_, v)| *v != 0.0);
            named.map_or(String::new(), |(name, v)| format!("{}{name}", if v < 0.0 { "-" } else { "" }))
        };
        format!("({})", seen.map(entry).join(", "))
    }

    /// A motion x' = L x + t, as a 4x4 matrix in the order of the convention.
    pub fn matrix(&self, linear: Matrix3<f64>, translation: [f64; 3]) -> [f64; 16] {
        let back = matrix3::transpose(self.map);
        let l = matrix3::multiply(matrix3::multiply(self.map, linear), back);
        let t = self.point(translation);
        let row = |i: usize| [l[i][0], l[i][1], l[i][2], t[i]];
        self.matrices.ordered([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]])
    }

    /// All numbers of a Gaussian, canonical frame and world alike.
    pub(crate) fn encode(&self, sample: &mut Sample, scales_are_logarithms: bool) {
        if self.map != SAME {
            remap(&self.map, sample);
        }
        if self.units != 1.0 {
            let scale = |sample: &mut Sample, field: Field, factor: f64| {
                sample[range(field)].iter_mut().for_each(|v| *v *= factor);
            };
            scale(sample, Field::Means, self.units);
            scale(sample, Field::Covariances, self.units * self.units);
            if scales_are_logarithms {
                let shift = skinsplat_core::math::portable::ln(self.units);
                sample[range(Field::Scales)].iter_mut().for_each(|v| *v += shift);
            } else {
                scale(sample, Field::Scales, self.units);
            }
        }
    }
}

/// The quaternion of M R Mᵀ for a signed permutation M, improper ones too.
pub(crate) fn turned_quaternion(map: &Matrix3<f64>, [w, x, y, z]: [f64; 4]) -> [f64; 4] {
    // The axis of a rotation is an axial vector: it turns with det(M) M.
    let [x, y, z] = matrix3::apply(*map, [x, y, z]).map(|c| c * matrix3::determinant(*map));
    [w, x, y, z]
}

/// Changes the axes of canonical frame and world: x' = M x.
pub(crate) fn remap(map: &Matrix3<f64>, sample: &mut Sample) {
    let apply = |sample: &mut Sample, field: Field| {
        let at = range(field).start;
        let moved = matrix3::apply(*map, [sample[at], sample[at + 1], sample[at + 2]]);
        sample[range(field)].copy_from_slice(&moved);
    };
    apply(sample, Field::Means);
    apply(sample, Field::Directions);
    let at = range(Field::Quaternions).start;
    let q = turned_quaternion(map, std::array::from_fn(|k| sample[at + k]));
    sample[range(Field::Quaternions)].copy_from_slice(&q);
    let at = range(Field::Scales).start;
    let s = matrix3::apply(map.map(|row| row.map(f64::abs)), [sample[at], sample[at + 1], sample[at + 2]]);
    sample[range(Field::Scales)].copy_from_slice(&s);
    turn_covariance(map, sample);
    turn_sh(map, sample);
}

/// M Σ Mᵀ.
pub(crate) fn turn_covariance(map: &Matrix3<f64>, sample: &mut Sample) {
    let at = range(Field::Covariances).start;
    let [xx, xy, xz, yy, yz, zz] = std::array::from_fn(|k| sample[at + k]);
    let m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let m = matrix3::multiply(matrix3::multiply(*map, m), matrix3::transpose(*map));
    sample[range(Field::Covariances)].copy_from_slice(&upper(&m));
}

/// xx, xy, xz, yy, yz, zz.
pub(crate) fn upper(m: &Matrix3<f64>) -> [f64; 6] {
    [m[0][0], m[0][1], m[0][2], m[1][1], m[1][2], m[2][2]]
}

/// SH that say along M d what they said along d.
pub(crate) fn turn_sh(map: &Matrix3<f64>, sample: &mut Sample) {
    let mut coefficients = sh_of(sample);
    if coefficients.as_flattened().iter().all(|c| *c == 0.0) {
        return;
    }
    turn_coefficients(map, &mut coefficients);
    put_sh(sample, &coefficients);
}

/// The same, of bare coefficients.
pub(crate) fn turn_coefficients(map: &Matrix3<f64>, coefficients: &mut [[f64; 3]; 16]) {
    let mirrored = matrix3::determinant(*map) < 0.0;
    let mut proper = *map;
    if mirrored {
        // M = P diag(1, 1, -1): the basis functions of odd l + m change their sign with z.
        proper.iter_mut().for_each(|row| row[2] = -row[2]);
        for (k, rgb) in coefficients.iter_mut().enumerate() {
            if odd_in_z(k) {
                rgb.iter_mut().for_each(|c| *c = -*c);
            }
        }
    }
    let q = rotation::matrix_to_quaternion(proper);
    sh::Rotation::from_quaternion(q, 3).apply(coefficients);
}

/// Degree l and order m of a coefficient.
pub(crate) fn degree_and_order(k: usize) -> (usize, i32) {
    let l = k.isqrt();
    (l, k as i32 - (l * l + l) as i32)
}

fn odd_in_z(k: usize) -> bool {
    let (l, m) = degree_and_order(k);
    (l as i32 + m).rem_euclid(2) == 1
}

/// The SH of a sample, coefficient by coefficient.
pub(crate) fn sh_of(sample: &Sample) -> [[f64; 3]; 16] {
    let start = range(Field::Sh0).start;
    std::array::from_fn(|k| std::array::from_fn(|channel| sample[start + 3 * k + channel]))
}

pub(crate) fn put_sh(sample: &mut Sample, coefficients: &[[f64; 3]; 16]) {
    let start = range(Field::Sh0).start;
    sample[start..start + 48].copy_from_slice(coefficients.as_flattened());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_orders_are_read() {
        let read = |text: &str| text.parse::<Convention>().map(|c| c.to_string());
        assert_eq!(read("unity").unwrap(), "unity,xyzw,column");
        assert_eq!(read("unity, wxyz,row").unwrap(), "unity,wxyz,row");
        assert_eq!(read("xyzw").unwrap(), "skinsplat,xyzw,row");
        let error = read("blender").unwrap_err().to_string();
        assert!(error.contains("`blender`") && error.contains("unreal"), "{error}");
    }

    #[test]
    fn mirrored_sh_say_the_same_of_mirrored_directions() {
        for convention in CONVENTIONS {
            let mut sample: Sample = std::array::from_fn(|k| ((k * 37 % 19) as f64 - 9.0) / 7.0);
            let before = sh_of(&sample);
            turn_sh(&convention.map, &mut sample);
            for d in [[0.6, 0.0, 0.8], [-0.48, 0.6, 0.64], [0.0, -0.8, -0.6]] {
                let old = sh::evaluate(3, &before, d);
                let new = sh::evaluate(3, &sh_of(&sample), matrix3::apply(convention.map, d));
                assert!((0..3).all(|c| (old[c] - new[c]).abs() < 1e-12), "{}", convention.name);
            }
        }
    }

    #[test]
    fn quaternions_turn_with_improper_maps_too() {
        let q = [0.5, 0.1, -0.7, 0.5].map(|c: f64| c);
        let q = rotation::normalize(q).unwrap();
        for Convention { map, name, .. } in CONVENTIONS {
            let expected = matrix3::multiply(
                matrix3::multiply(map, rotation::quaternion_to_matrix(q)),
                matrix3::transpose(map),
            );
            let found = rotation::quaternion_to_matrix(turned_quaternion(&map, q));
            let error =
                (0..9).map(|k| (found[k / 3][k % 3] - expected[k / 3][k % 3]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12, "{name}: {error}");
        }
    }
}
