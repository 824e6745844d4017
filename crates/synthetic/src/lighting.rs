//! Light and reflection: Lambert and GGX with Schlick's Fresnel term under four soft directional lights, and a smooth
//! surrounding for ambient light and mirror reflections. No shadows are cast: what a pose does to the light is left to
//! normals, so that a comparison of skinning strategies is not one of missing shadows; creases are darkened by an
//! ambient occlusion that belongs to the surface.

use glam::Vec3;
use skinsplat_core::math::portable;

/// What the surface is made of at a point. Colours are linear, not sRGB.
#[derive(Clone, Copy, Debug)]
pub(super) struct Finish {
    pub(super) albedo: Vec3,
    /// Perceptual roughness; GGX's α is its square.
    pub(super) roughness: f32,
    /// Reflectance at normal incidence.
    pub(super) reflectance: f32,
}

struct Light {
    /// Unit vector to the light.
    direction: Vec3,
    /// Irradiance at normal incidence divided by π, linear.
    colour: Vec3,
}

/// Key, fill, rim and back light.
const LIGHTS: [Light; 4] = [
    Light { direction: Vec3::new(0.476_731, 0.572_078, 0.667_424), colour: Vec3::new(0.78, 0.74, 0.68) },
    Light { direction: Vec3::new(-0.825_723, 0.206_431, 0.524_935), colour: Vec3::new(0.22, 0.26, 0.33) },
    Light { direction: Vec3::new(-0.408_248, 0.408_248, -0.816_497), colour: Vec3::new(0.44, 0.45, 0.48) },
    Light { direction: Vec3::new(0.700_140, 0.140_028, -0.700_140), colour: Vec3::new(0.30, 0.27, 0.24) },
];

/// Half width of a light as a roughness: sharper highlights are not seen under lights of this size.
const LIGHT_SIZE: f32 = 0.22;
/// Lambert's cosine is wrapped by this much, as under lights of some size.
const WRAP: f32 = 0.15;

/// Radiance of the surrounding from a direction: bright above, dark below, a soft window to the front left.
fn surrounding(direction: Vec3, roughness: f32) -> Vec3 {
    let height = (direction.y * 0.5 + 0.5).clamp(0.0, 1.0);
    let sky =
        Vec3::new(0.12, 0.11, 0.10).lerp(Vec3::new(0.58, 0.62, 0.68), height * height * (3.0 - 2.0 * height));
    let window = direction.dot(Vec3::new(-0.549_442, 0.457_869, 0.699_290));
    let edge = 0.08 + roughness * 0.6;
    let glow = ((window - 0.80 + edge) / (2.0 * edge)).clamp(0.0, 1.0);
    sky + Vec3::splat(0.9 * glow * glow * (1.0 - 0.6 * roughness))
}

/// Linear radiance towards `view` (unit vector from the surface to the eye) of a surface with unit `normal`, where
/// `openness` (1 in the open, 0 in a deep crease) dims what comes from the surrounding.
pub(super) fn shade(finish: Finish, normal: Vec3, view: Vec3, openness: f32) -> Vec3 {
    let facing = normal.dot(view).max(1e-3);
    let alpha = (finish.roughness * finish.roughness).max(LIGHT_SIZE * LIGHT_SIZE);
    let mut radiance = finish.albedo * surrounding(normal, 1.0) * openness;
    for light in &LIGHTS {
        let cosine = normal.dot(light.direction);
        let wrapped = ((cosine + WRAP) / (1.0 + WRAP)).max(0.0);
        radiance += finish.albedo * light.colour * (wrapped * (0.4 + 0.6 * openness));
        if cosine > 0.0 {
            let specular = ggx(finish.reflectance, alpha, normal, view, light.direction, facing, cosine);
            radiance += light.colour * (specular * cosine * openness);
        }
    }
    let mirrored = 2.0 * normal.dot(view) * normal - view;
    let grazing = schlick(finish.reflectance, facing) * (1.0 - 0.7 * finish.roughness);
    radiance + surrounding(mirrored, finish.roughness) * (grazing * openness)
}

/// Schlick's approximation of Fresnel's equations; a reflectance below 2 % takes the grazing reflection away as well.
fn schlick(reflectance: f32, cosine: f32) -> f32 {
    let grazing = (reflectance * 50.0).min(1.0);
    reflectance + (grazing - reflectance) * portable::powi((1.0 - cosine).clamp(0.0, 1.0), 5)
}

/// π D F V: GGX distribution, Schlick's Fresnel term, and the separable fit 1 / (2 lerp(2 n·l n·v, n·l + n·v, α)) to
/// Smith's height-correlated visibility.
fn ggx(reflectance: f32, alpha: f32, normal: Vec3, view: Vec3, light: Vec3, facing: f32, cosine: f32) -> f32 {
    let half = (view + light).normalize_or_zero();
    let (n_h, v_h) = (normal.dot(half).clamp(0.0, 1.0), view.dot(half).clamp(0.0, 1.0));
    let spread = n_h * n_h * (alpha * alpha - 1.0) + 1.0;
    let distribution = alpha * alpha / (spread * spread);
    let open = 2.0 * cosine * facing;
    let visibility = 0.5 / (open + (cosine + facing - open) * alpha);
    distribution * visibility * schlick(reflectance, v_h)
}

/// Linear radiance to sRGB values in \[0, 1\], with highlights rolled off smoothly instead of clipped.
pub(super) fn to_srgb(radiance: Vec3) -> [f32; 3] {
    radiance.to_array().map(|c| {
        // The identity up to the knee, then an exponential approach to 1 with the same slope.
        const KNEE: f32 = 0.7;
        let rolled = if c <= KNEE {
            c.max(0.0)
        } else {
            1.0 - (1.0 - KNEE) * portable::exp(-(c - KNEE) / (1.0 - KNEE))
        };
        if rolled <= 0.003_130_8 { 12.92 * rolled } else { 1.055 * portable::pow(rolled, 1.0 / 2.4) - 0.055 }
    })
}

/// sRGB value to linear.
pub(super) fn to_linear(srgb: [f32; 3]) -> Vec3 {
    Vec3::from_array(
        srgb.map(|c| if c <= 0.040_45 { c / 12.92 } else { portable::pow((c + 0.055) / 1.055, 2.4) }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_of_lights_are_unit_vectors() {
        LIGHTS.iter().for_each(|light| assert!((light.direction.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn without_reflectance_the_view_does_not_matter_and_with_it_it_does() {
        let normal = Vec3::new(0.3, 0.4, 0.9).normalize();
        let views = [normal, Vec3::Z, Vec3::new(0.8, 0.1, 0.6).normalize()];
        let seen = |reflectance| {
            let finish = Finish { albedo: Vec3::new(0.5, 0.3, 0.2), roughness: 0.3, reflectance };
            views.map(|view| shade(finish, normal, view, 1.0))
        };
        let [a, b, c] = seen(0.0);
        assert!(a == b && b == c);
        let [a, b, c] = seen(0.045);
        assert!((a - b).length() > 0.01 && (b - c).length() > 0.01);
    }

    #[test]
    fn srgb_is_monotone_bounded_and_exact_below_the_knee() {
        let values: Vec<f32> = (0..2000).map(|i| to_srgb(Vec3::splat(i as f32 * 0.005))[0]).collect();
        assert!(values.windows(2).all(|w| w[1] >= w[0]) && values.iter().all(|v| (0.0..=1.0).contains(v)));
        for c in [0.0, 0.01, 0.2, 0.8] {
            assert!((to_srgb(to_linear([c; 3]))[0] - c).abs() < 1e-6);
        }
    }
}
