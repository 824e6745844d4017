//! Small random scenes for the rasterizer's property tests.
#![allow(dead_code, unreachable_pub, reason = "shared by tests")]

use glam::{DMat3, DMat4, DVec3, Mat3, Quat, Vec3};
use skinsplat_core::scene::{Camera, ColourClamp, OwnedPosed};
use skinsplat_render::View;

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    /// A random rotation.
    pub fn rotation(&mut self) -> Quat {
        let [x, y, z, w] = std::array::from_fn(|_| self.between(-1.0, 1.0) as f32);
        Quat::from_xyzw(x, y, z, w + 0.1).normalize()
    }
}

/// What a view has besides its camera.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub background: [f32; 3],
    pub antialiased: bool,
}

impl Settings {
    pub fn random(random: &mut Random) -> Self {
        let background = std::array::from_fn(|_| random.unit() as f32);
        Self { background, antialiased: random.below(2) == 0 }
    }

    pub fn view(self, camera: &Camera) -> View<'_> {
        View::new(camera).over(self.background).antialiased(self.antialiased)
    }
}

/// A camera with any principal point, that looks at the origin from a few metres away; every fourth one is a reflection.
pub fn camera(random: &mut Random, width: u32, height: u32) -> Camera {
    let eye = DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(2.5, 4.0));
    let focal = random.between(0.6, 2.0) * f64::from(width.max(height));
    let mut camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, focal, width, height);
    camera.fy *= random.between(0.8, 1.2);
    camera.cx += random.between(-0.3, 0.3) * f64::from(width);
    camera.cy += random.between(-0.3, 0.3) * f64::from(height);
    if random.below(4) == 0 {
        let mirror = DMat4::from_mat3(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)));
        camera.camera_from_world = mirror * camera.camera_from_world;
    }
    camera
}

/// True if no two view depths are so close that an f32 may not tell them apart: ties are drawn in the order of the list.
pub fn has_distinct_depths(posed: &OwnedPosed, camera: &Camera) -> bool {
    let depth = |mean: &Vec3| camera.camera_from_world.transform_point3(mean.as_dvec3()).z;
    let mut depths: Vec<f64> = posed.means.iter().map(depth).collect();
    depths.sort_by(f64::total_cmp);
    depths.windows(2).all(|pair| pair[1] - pair[0] > 1e-6 * pair[1].abs())
}

/// Gaussians about the origin, some of them behind the cameras of [`camera`].
pub fn posed(random: &mut Random, count: usize) -> OwnedPosed {
    let sh_degree = random.below(4);
    let coefficients = (sh_degree + 1) * (sh_degree + 1);
    let means = (0..count)
        .map(|_| {
            Vec3::from_array(std::array::from_fn(|_| random.between(-1.2, 1.2) as f32))
                * Vec3::new(1.0, 1.0, 2.5)
        })
        .collect();
    let factors = (0..count)
        .map(|_| {
            let size = random.between(-4.5, -0.7);
            let scale = std::array::from_fn(|_| (size + random.between(-0.8, 0.8)).exp() as f32);
            Mat3::from_quat(random.rotation()) * Mat3::from_diagonal(Vec3::from_array(scale))
        })
        .collect();
    let opacities: Vec<f32> = (0..count).map(|_| random.unit() as f32).collect();
    let sh: Vec<[f32; 3]> = (0..count * coefficients)
        .map(|_| std::array::from_fn(|_| random.between(-0.5, 0.5) as f32))
        .collect();
    let framed = random.below(2) == 0;
    let view_frames = framed.then(|| (0..count).map(|_| Mat3::from_quat(random.rotation())).collect());
    let colour_clamp = [ColourClamp::NonNegative, ColourClamp::Unit][random.below(2)];
    OwnedPosed { means, factors, opacities, sh_degree, sh, view_frames, colour_clamp, rotations: None }
}

/// The Gaussians with these indices, in this order.
pub fn chosen(posed: &OwnedPosed, indices: &[usize]) -> OwnedPosed {
    let k = (posed.sh_degree + 1).pow(2);
    OwnedPosed {
        means: indices.iter().map(|&i| posed.means[i]).collect(),
        factors: indices.iter().map(|&i| posed.factors[i]).collect(),
        opacities: indices.iter().map(|&i| posed.opacities[i]).collect(),
        sh_degree: posed.sh_degree,
        sh: indices.iter().flat_map(|&i| posed.sh[i * k..(i + 1) * k].to_vec()).collect(),
        view_frames: posed.view_frames.as_ref().map(|f| indices.iter().map(|&i| f[i]).collect()),
        colour_clamp: posed.colour_clamp,
        rotations: None,
    }
}
