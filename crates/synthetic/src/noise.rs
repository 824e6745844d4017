//! Repeatable noise: a hash of lattice points, smoothly interpolated.

use glam::{IVec3, Vec3};

/// A uniform value in \[0, 1) from a lattice point and a seed.
pub(super) fn hash(point: IVec3, seed: u32) -> f32 {
    // Multiplicative mixing with odd constants (golden ratio and relatives), then an avalanche of shifts.
    let mut h = seed.wrapping_mul(0x9e37_79b9);
    for c in point.to_array() {
        h = (h ^ c as u32).wrapping_mul(0x85eb_ca6b);
        h ^= h >> 15;
    }
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^= h >> 16;
    (h >> 8) as f32 / (1 << 24) as f32
}

/// Value noise in \[0, 1\], one lattice cell per unit.
pub(super) fn value(point: Vec3, seed: u32) -> f32 {
    let floor = point.floor();
    let cell = floor.as_ivec3();
    let f = point - floor;
    let s = f * f * (Vec3::splat(3.0) - 2.0 * f);
    let corner = |x, y, z| hash(cell + IVec3::new(x, y, z), seed);
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let along_x = |y, z| lerp(corner(0, y, z), corner(1, y, z), s.x);
    lerp(lerp(along_x(0, 0), along_x(1, 0), s.y), lerp(along_x(0, 1), along_x(1, 1), s.y), s.z)
}

/// Three octaves of value noise, in \[0, 1\].
pub(super) fn fractal(point: Vec3, seed: u32) -> f32 {
    (value(point, seed) * 4.0 + value(point * 2.03, seed ^ 1) * 2.0 + value(point * 4.1, seed ^ 2)) / 7.0
}
