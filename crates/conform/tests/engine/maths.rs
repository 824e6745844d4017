//! Vectors, quaternions, matrices and SH, written out.

pub type V3 = [f64; 3];
pub type Q = [f64; 4];
pub type M3 = [[f64; 3]; 3];

pub fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn unit3(v: V3) -> V3 {
    let n = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|c| c / n)
}

pub fn apply(m: &M3, v: V3) -> V3 {
    std::array::from_fn(|r| (0..3).map(|c| m[r][c] * v[c]).sum())
}

pub fn transpose(m: &M3) -> M3 {
    std::array::from_fn(|r| std::array::from_fn(|c| m[c][r]))
}

pub fn product(a: &M3, b: &M3) -> M3 {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..3).map(|k| a[r][k] * b[k][c]).sum()))
}

pub fn dot(a: Q, b: Q) -> f64 {
    (0..4).map(|k| a[k] * b[k]).sum()
}

pub fn unit(q: Q) -> Q {
    let n = dot(q, q).sqrt();
    q.map(|c| c / n)
}

pub fn conj([w, x, y, z]: Q) -> Q {
    [w, -x, -y, -z]
}

pub fn mul([a, b, c, d]: Q, [e, f, g, h]: Q) -> Q {
    [
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    ]
}

pub fn mat(q: Q) -> M3 {
    let [w, x, y, z] = unit(q);
    [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
}

/// The matrix of 3DGS, without normalising.
pub fn raw([w, x, y, z]: Q) -> M3 {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Shepperd: through w where the trace is positive, else through the largest diagonal entry.
pub fn from_matrix(m: &M3) -> Q {
    let t = m[0][0] + m[1][1] + m[2][2];
    let q = if t > 0.0 {
        [1.0 + t, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    } else if m[0][0] > m[1][1] && m[0][0] > m[2][2] {
        [m[2][1] - m[1][2], 1.0 + m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[0][2] + m[2][0]]
    } else if m[1][1] > m[2][2] {
        [m[0][2] - m[2][0], m[0][1] + m[1][0], 1.0 - m[0][0] + m[1][1] - m[2][2], m[1][2] + m[2][1]]
    } else {
        [m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], 1.0 - m[0][0] - m[1][1] + m[2][2]]
    };
    unit(q)
}

/// The leading eigenvector: the matrix squared until only that is left, then its longest column.
pub fn leading(mut a: [[f64; 4]; 4]) -> Q {
    for _ in 0..30 {
        let largest = a.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
        let s: [[f64; 4]; 4] = a.map(|row| row.map(|v| v / largest));
        a = std::array::from_fn(|r| std::array::from_fn(|c| (0..4).map(|k| s[r][k] * s[k][c]).sum()));
    }
    let k = (0..4).max_by(|&i, &j| a[i][i].total_cmp(&a[j][j])).unwrap();
    unit(std::array::from_fn(|r| a[r][k]))
}

/// The basis of 3DGS in a unit direction.
pub fn basis([x, y, z]: V3) -> [f64; 16] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.282_094_791_773_878_14,
        -0.488_602_511_902_919_9 * y,
        0.488_602_511_902_919_9 * z,
        -0.488_602_511_902_919_9 * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.315_391_565_252_520_05 * (2.0 * zz - xx - yy),
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (xx - yy),
        -0.590_043_589_926_643_5 * y * (3.0 * xx - yy),
        2.890_611_442_640_554 * x * y * z,
        -0.457_045_799_464_465_8 * y * (4.0 * zz - xx - yy),
        0.373_176_332_590_115_4 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_799_464_465_8 * x * (4.0 * zz - xx - yy),
        1.445_305_721_320_277 * z * (xx - yy),
        -0.590_043_589_926_643_5 * x * (xx - 3.0 * yy),
    ]
}

/// Coefficients that say along d what the given ones say along Rᵀ d: asked in many directions, and solved for.
pub fn turned(sh: &[V3], r: &M3) -> Vec<V3> {
    const DIRECTIONS: usize = 48;
    let mut normal = [[0.0; 16]; 16];
    let mut right = vec![[0.0; 3]; 16];
    for i in 0..DIRECTIONS {
        // A spiral from pole to pole.
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64;
        let (s, c) = (i as f64 * 2.399_963_229_728_653).sin_cos();
        let rho = (1.0 - z * z).sqrt();
        let d = [rho * c, rho * s, z];
        let (new, old) = (basis(d), basis(apply(&transpose(r), d)));
        for a in 0..16 {
            for b in 0..16 {
                normal[a][b] += new[a] * new[b];
            }
            for channel in 0..3 {
                let value: f64 = (0..16).map(|k| old[k] * sh[k][channel]).sum();
                right[a][channel] += new[a] * value;
            }
        }
    }
    // Gauss-Jordan; the matrix is symmetric, positive and far from singular.
    for k in 0..16 {
        let pivot = normal[k][k];
        normal[k].iter_mut().for_each(|v| *v /= pivot);
        right[k].iter_mut().for_each(|v| *v /= pivot);
        for r in (0..16).filter(|&r| r != k) {
            let f = normal[r][k];
            for c in 0..16 {
                normal[r][c] -= f * normal[k][c];
            }
            for c in 0..3 {
                right[r][c] -= f * right[k][c];
            }
        }
    }
    right
}
