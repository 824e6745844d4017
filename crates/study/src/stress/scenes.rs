//! Scenes that are hard to draw, in families along an axis.

use glam::{DMat4, DVec3, Mat3, Quat, Vec3};
use skinsplat_core::math::portable;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::scene::{Camera, OwnedPosed};

/// Side of the images, pixels.
const SIDE: u32 = 64;

/// Focal length, pixels.
const FOCAL: f64 = 100.0;

/// Something to draw, and what the image should be where that is not the definition's image of the same numbers.
pub(super) struct Scene {
    pub(super) posed: OwnedPosed,
    pub(super) camera: Camera,
    /// The same scene in easier numbers.
    pub(super) truth: Option<(OwnedPosed, Camera)>,
}

/// Scenes along one axis.
pub(super) struct Family {
    pub(super) id: &'static str,
    pub(super) axis: &'static str,
    /// From easy to hard where there is such an order.
    pub(super) points: &'static [f64],
    /// The value at which something breaks can be found by bisection.
    pub(super) continuous: bool,
    pub(super) make: fn(f64) -> Scene,
}

fn camera() -> Camera {
    let (cx, cy) = (f64::from(SIDE) / 2.0, f64::from(SIDE) / 2.0);
    Camera { width: SIDE, height: SIDE, fx: FOCAL, fy: FOCAL, cx, cy, camera_from_world: DMat4::IDENTITY }
}

fn gaussians(means: Vec<Vec3>, factors: Vec<Mat3>, opacities: Vec<f32>, sh: Vec<[f32; 3]>) -> OwnedPosed {
    OwnedPosed { means, factors, opacities, sh, ..OwnedPosed::default() }
}

fn single(mean: Vec3, factor: Mat3, opacity: f32) -> Scene {
    let posed = gaussians(vec![mean], vec![factor], vec![opacity], vec![[1.0, 0.5, -0.5]]);
    Scene { posed, camera: camera(), truth: None }
}

/// Two hundred Gaussians about the origin, `spread` metres across.
fn cloud(centre: DVec3) -> OwnedPosed {
    let mut random = SplitMix64::new(3);
    let n = 200;
    let mut number = |low: f32, high: f32| low + (high - low) * random.unit_f32();
    let (mut means, mut factors, mut opacities, mut sh) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for _ in 0..n {
        let mean = Vec3::new(number(-0.5, 0.5), number(-0.5, 0.5), number(-0.5, 0.5));
        means.push((mean.as_dvec3() + centre).as_vec3());
        let axis = Vec3::new(number(-1.0, 1.0), number(-1.0, 1.0), number(-1.0, 1.0));
        let scales = Vec3::new(number(0.02, 0.1), number(0.02, 0.1), number(0.005, 0.02));
        factors.push(Mat3::from_quat(turned(axis * 3.0)) * Mat3::from_diagonal(scales));
        opacities.push(number(0.2, 1.0));
        sh.push([number(-1.5, 1.5), number(-1.5, 1.5), number(-1.5, 1.5)]);
    }
    gaussians(means, factors, opacities, sh)
}

fn looking(eye: DVec3, target: DVec3, focal: f64) -> Camera {
    Camera::look_at(eye, target, DVec3::Y, focal, SIDE, SIDE)
}

const EYE: DVec3 = DVec3::new(0.4, 0.3, 2.5);

fn from_afar(distance: f64) -> Scene {
    let eye = EYE.normalize() * distance;
    Scene {
        posed: cloud(DVec3::ZERO),
        camera: looking(eye, DVec3::ZERO, FOCAL * distance / 2.5),
        truth: None,
    }
}

fn shifted(distance: f64) -> Scene {
    let shift = DVec3::new(0.6, 0.0, 0.8) * distance;
    Scene {
        posed: cloud(shift),
        camera: looking(EYE + shift, shift, FOCAL),
        truth: Some((cloud(DVec3::ZERO), looking(EYE, DVec3::ZERO, FOCAL))),
    }
}

/// The turn about an axis by its length in radians.
fn turned(axis: Vec3) -> Quat {
    portable::from_scaled_axis(axis.as_dvec3()).as_quat()
}

/// One Gaussian two metres away, as long as `ratio` times its thickness of 1 mm, slanted.
fn needle(ratio: f64) -> Scene {
    let turn = Mat3::from_quat(turned(Vec3::Z * 0.7) * turned(Vec3::Y * 0.2));
    let scales = Vec3::new((1e-3 * ratio) as f32, 1e-3, 1e-3);
    single(Vec3::new(0.0, 0.0, 2.0), turn * Mat3::from_diagonal(scales), 0.8)
}

fn one_per_pixel(_: f64) -> Scene {
    let side = SIDE as usize;
    let at = |i: usize| {
        let [x, y] = [i % side, i / side].map(|k| (k as f32 + 0.5 - 0.5 * SIDE as f32) / FOCAL as f32);
        Vec3::new(x, y, 1.0) * 2.0
    };
    let n = side * side;
    let colour =
        |i: usize| [(i % 7) as f32 * 0.3 - 1.0, (i % 11) as f32 * 0.2 - 1.0, (i % 5) as f32 * 0.4 - 1.0];
    let posed = gaussians(
        (0..n).map(at).collect(),
        vec![Mat3::IDENTITY * 0.004; n],
        vec![0.7; n],
        (0..n).map(colour).collect(),
    );
    Scene { posed, camera: camera(), truth: None }
}

fn crowd(count: f64) -> Scene {
    let n = count as usize;
    let posed = gaussians(
        vec![Vec3::new(0.0, 0.0, 2.0); n],
        vec![Mat3::IDENTITY * 10.0; n],
        vec![0.005; n],
        (0..n).map(|i| [(i % 3) as f32 - 1.0, 0.5, -0.5]).collect(),
    );
    Scene { posed, camera: Camera { width: 16, height: 16, cx: 8.0, cy: 8.0, ..camera() }, truth: None }
}

/// SH of degree 3 whose every coefficient is that large.
fn loud(coefficient: f64) -> Scene {
    let mut scene = single(Vec3::new(0.1, 0.2, 2.0), Mat3::IDENTITY * 0.2, 0.9);
    scene.posed.sh_degree = 3;
    let sign = |i: usize| if i.is_multiple_of(3) { -1.0 } else { 1.0 };
    let value = |i: usize| {
        [coefficient as f32, -0.5 * coefficient as f32, 0.25 * coefficient as f32].map(|v| v * sign(i))
    };
    scene.posed.sh = (0..16).map(value).collect();
    scene
}

/// Every family.
pub(super) const FAMILIES: [Family; 13] = [
    Family {
        id: "near plane",
        axis: "view depth, metres (drawn beyond 0.2)",
        points: &[1.0, 0.3, 0.200_001, 0.2, 0.199_999, 0.1, 0.0, -1.0],
        continuous: false,
        make: |z| single(Vec3::new(0.0, 0.0, z as f32), Mat3::IDENTITY * 0.05, 0.8),
    },
    Family {
        id: "Jacobian clamp",
        axis: "x/z over that of the image's edge (clamped from 1.3 on)",
        points: &[0.0, 1.0, 1.29, 1.3, 1.31, 1.6, 2.0, 5.0],
        continuous: false,
        make: |k| single(Vec3::new((0.64 * k) as f32, 0.1, 2.0), Mat3::IDENTITY * 0.5, 0.8),
    },
    Family {
        id: "larger than the screen",
        axis: "standard deviation, metres, two metres away",
        points: &[0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6],
        continuous: true,
        make: |s| single(Vec3::new(0.1, 0.0, 2.0), Mat3::IDENTITY * s as f32, 0.5),
    },
    Family {
        id: "tiny",
        axis: "standard deviation, metres, two metres away",
        points: &[1e-1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-20, 1e-38],
        continuous: true,
        make: |s| single(Vec3::new(0.1, 0.0, 2.0), Mat3::IDENTITY * s as f32, 0.5),
    },
    Family {
        id: "needle",
        axis: "length over thickness (1 mm), two metres away, slanted",
        points: &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e8, 1e12],
        continuous: true,
        make: needle,
    },
    Family {
        id: "opacity",
        axis: "opacity (drawn from 1/255 on)",
        points: &[0.5, 0.99, 1.0, 0.01, 0.003_921_569_2, 0.003_921_568_6, 0.003_921_568, 1e-3, 0.0],
        continuous: false,
        make: |o| single(Vec3::new(0.1, 0.0, 2.0), Mat3::IDENTITY * 0.3, o as f32),
    },
    Family {
        id: "SH size",
        axis: "every coefficient up to degree 3; errors relative to it",
        points: &[1.0, 1e2, 1e4, 1e8, 1e16, 1e30],
        continuous: true,
        make: loud,
    },
    Family {
        id: "camera far",
        axis: "distance of the camera, metres, focal length in proportion",
        points: &[2.5, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7],
        continuous: true,
        make: from_afar,
    },
    Family {
        id: "scene shifted",
        axis: "distance of scene and camera from the origin, metres",
        points: &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7],
        continuous: true,
        make: shifted,
    },
    Family {
        id: "one per pixel",
        axis: "4,096 Gaussians on pixel centres",
        points: &[1.0],
        continuous: false,
        make: one_per_pixel,
    },
    Family {
        id: "crowd in a tile",
        axis: "Gaussians at one place",
        points: &[1.0, 1e3, 1e5, 1e6],
        continuous: false,
        make: crowd,
    },
    Family {
        id: "thin",
        axis: "least standard deviation of a disc of 10 cm, metres",
        points: &[1e-2, 1e-4, 1e-8, 1e-12, 0.0],
        continuous: false,
        make: |s| {
            let turn = Mat3::from_quat(turned(Vec3::Y * 1.57));
            single(Vec3::new(0.1, 0.0, 2.0), turn * Mat3::from_diagonal(Vec3::new(0.1, 0.1, s as f32)), 0.8)
        },
    },
    Family {
        id: "focal length",
        axis: "pixels, the scene in proportion",
        points: &[1e2, 1e3, 1e5, 1e7],
        continuous: false,
        make: |f| {
            let mut scene = single(Vec3::new(0.0, 0.0, (f / 50.0) as f32), Mat3::IDENTITY * 0.1, 0.8);
            (scene.camera.fx, scene.camera.fy) = (f, f);
            scene
        },
    },
];
