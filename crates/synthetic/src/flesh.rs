//! The flesh on the joints: capsules of the reference adult, placed on a figure of given proportions.

use super::field::{Capsule, Field, Part};
use super::skeleton::{ARM_Y, ARM_Z, FINGERS, Placement, Proportions};
use super::surface::Lens;
use glam::DVec3;

/// The implicit body.
pub(super) fn flesh(proportions: Proportions) -> Field {
    let pen = Pen { place: Placement(proportions), girth: proportions.girth, mirror: 1.0 };
    let thin = Pen { girth: 1.0, ..pen };
    let (right, thin_right) = (Pen { mirror: -1.0, ..pen }, Pen { mirror: -1.0, ..thin });
    let part = |capsules, blend: f64, join: f64| {
        Part::new(capsules, blend * pen.place.scale(), join * pen.place.scale())
    };
    let parts = vec![
        part(torso(pen), 0.035, 0.05),
        part(head(thin), 0.016, 0.03),
        part(leg(pen), 0.03, 0.035),
        part(leg(right), 0.03, 0.035),
        part(foot(thin), 0.018, 0.02),
        part(foot(thin_right), 0.018, 0.02),
        part(arm(pen), 0.012, 0.045),
        part(arm(right), 0.012, 0.045),
        part(hand(thin), 0.006, 0.012),
        part(hand(thin_right), 0.006, 0.012),
    ];
    Field { parts, floor: Some((0.0, 0.012 * pen.place.scale())) }
}

/// Where the mesh is finer than `edge`: fingers need cells of 5.6 mm to stay apart, a face some of 12 mm.
pub(super) fn lenses(proportions: Proportions, edge: f64) -> Vec<Lens> {
    let place = Placement(proportions);
    let lens = |centre: [f64; 3], radius: f64, cell: f64| Lens {
        centre: place.point(centre),
        radius: radius * place.scale(),
        power: (edge / (cell * place.scale())).max(1.0),
    };
    let hand = |mirror: f64| lens([mirror * 0.79, ARM_Y, ARM_Z + 0.01], 0.072, 0.0056);
    vec![lens([0.0, 1.62, 0.06], 0.085, 0.0125), hand(1.0), hand(-1.0)]
}

/// Draws capsules given on the reference adult's left side.
#[derive(Clone, Copy)]
struct Pen {
    place: Placement,
    girth: f64,
    mirror: f64,
}

impl Pen {
    fn point(self, [x, y, z]: [f64; 3]) -> DVec3 {
        self.place.point([x * self.mirror, y, z])
    }

    fn bone(self, a: [f64; 3], radius_a: f64, b: [f64; 3], radius_b: f64) -> Capsule {
        self.flat(a, radius_a, b, radius_b, [1.0; 3])
    }

    fn flat(self, a: [f64; 3], radius_a: f64, b: [f64; 3], radius_b: f64, stretch: [f64; 3]) -> Capsule {
        let thickness = self.girth * self.place.scale();
        let (a, b) = (self.point(a), self.point(b));
        Capsule::stretched(a, radius_a * thickness, b, radius_b * thickness, DVec3::from_array(stretch))
    }

    fn ball(self, centre: [f64; 3], radius: f64, stretch: [f64; 3]) -> Capsule {
        self.flat(centre, radius, centre, radius, stretch)
    }
}

fn torso(pen: Pen) -> Vec<Capsule> {
    let right = Pen { mirror: -1.0, ..pen };
    let mut torso = vec![
        pen.flat([0.0, 1.00, -0.008], 0.122, [0.0, 0.93, -0.012], 0.130, [1.15, 1.0, 0.80]), // hips
        pen.flat([0.0, 1.02, -0.006], 0.126, [0.0, 1.14, -0.006], 0.114, [1.12, 1.0, 0.80]), // waist
        pen.flat([0.0, 1.14, -0.006], 0.112, [0.0, 1.29, -0.018], 0.130, [1.16, 1.0, 0.80]), // ribs
        pen.flat([0.0, 1.28, -0.020], 0.128, [0.0, 1.335, -0.026], 0.112, [1.18, 1.0, 0.78]), // chest
        pen.bone([-0.10, 1.412, -0.034], 0.052, [0.10, 1.412, -0.034], 0.052),               // clavicles
        pen.bone([0.0, 1.42, -0.036], 0.060, [0.0, 1.50, -0.016], 0.052),                    // neck
    ];
    for side in [pen, right] {
        torso.extend([
            side.bone([0.055, 1.305, 0.040], 0.060, [0.085, 1.325, 0.026], 0.056), // pectoral
            side.bone([0.115, 1.33, -0.050], 0.055, [0.080, 1.16, -0.035], 0.055), // latissimus
            side.bone([0.02, 1.475, -0.036], 0.032, [0.14, 1.432, -0.036], 0.036), // trapezius
            side.ball([0.066, 0.895, -0.070], 0.080, [1.0, 1.05, 0.9]),            // buttock
        ]);
    }
    torso
}

fn head(pen: Pen) -> Vec<Capsule> {
    let right = Pen { mirror: -1.0, ..pen };
    let mut head = vec![
        pen.flat([0.0, 1.642, -0.012], 0.098, [0.0, 1.640, 0.022], 0.092, [0.86, 1.0, 1.0]), // cranium
        pen.flat([0.0, 1.610, 0.030], 0.078, [0.0, 1.556, 0.052], 0.050, [0.90, 1.0, 1.0]),  // jaw
        pen.bone([-0.008, 1.538, 0.080], 0.020, [0.008, 1.538, 0.080], 0.020),               // chin
        pen.bone([0.0, 1.640, 0.108], 0.008, [0.0, 1.600, 0.123], 0.0125),                   // nose
        pen.bone([-0.014, 1.567, 0.098], 0.009, [0.014, 1.567, 0.098], 0.009),               // lips
        pen.bone([0.0, 1.50, -0.016], 0.050, [0.0, 1.57, 0.0], 0.048),                       // nape
    ];
    for side in [pen, right] {
        head.extend([
            side.bone([0.018, 1.660, 0.096], 0.013, [0.046, 1.657, 0.084], 0.013), // brow
            side.ball([0.040, 1.606, 0.068], 0.030, [1.0; 3]),                     // cheek
            side.flat([0.085, 1.640, -0.006], 0.024, [0.079, 1.602, 0.002], 0.015, [0.45, 1.0, 0.8]), // ear
        ]);
    }
    head
}

fn arm(pen: Pen) -> Vec<Capsule> {
    let on_arm = |x: f64, y: f64, z: f64| [x, ARM_Y + y, ARM_Z + z];
    vec![
        pen.bone(on_arm(0.160, 0.0, -0.002), 0.060, on_arm(0.25, 0.0, 0.0), 0.046), // deltoid
        pen.bone(on_arm(0.25, 0.0, 0.0), 0.045, on_arm(0.435, 0.0, 0.0), 0.038),
        pen.bone(on_arm(0.26, 0.0, 0.007), 0.043, on_arm(0.36, 0.0, 0.005), 0.039), // biceps
        pen.bone(on_arm(0.435, 0.0, 0.0), 0.038, on_arm(0.685, 0.0, 0.0), 0.027),
        pen.flat(on_arm(0.475, 0.0, 0.003), 0.040, on_arm(0.60, 0.0, 0.001), 0.033, [1.0, 0.96, 1.04]),
    ]
}

fn hand(pen: Pen) -> Vec<Capsule> {
    let flat = [1.0, 0.52, 1.0];
    let mut hand = vec![
        pen.flat([0.675, ARM_Y, ARM_Z], 0.027, [0.705, ARM_Y, ARM_Z], 0.028, [1.0, 0.85, 1.05]), // wrist
        pen.flat([0.705, ARM_Y, ARM_Z + 0.002], 0.031, [0.752, ARM_Y, -0.006], 0.026, flat),
        pen.flat([0.705, ARM_Y, ARM_Z - 0.002], 0.031, [0.748, ARM_Y - 0.002, -0.052], 0.025, flat),
        pen.bone([0.700, ARM_Y - 0.004, -0.012], 0.016, [0.722, ARM_Y - 0.008, 0.014], 0.014), // ball of the thumb
    ];
    // Webs between the fingers.
    hand.push(pen.bone([0.778, ARM_Y - 0.001, 0.003], 0.0085, [0.782, ARM_Y, -0.020], 0.0085));
    hand.push(pen.bone([0.782, ARM_Y, -0.020], 0.0085, [0.778, ARM_Y - 0.001, -0.044], 0.0085));
    hand.push(pen.bone([0.778, ARM_Y - 0.001, -0.044], 0.0085, [0.765, ARM_Y - 0.004, -0.065], 0.008));
    for finger in &FINGERS {
        let points = finger.points();
        let [at_knuckle, at_tip] = finger.radii;
        for k in 0..3 {
            let radius = |k: usize| at_knuckle + (at_tip - at_knuckle) * k as f64 / 3.0;
            // The fingertip's sphere ends where the finger does.
            let end = if k == 2 { points[2].lerp(points[3], 0.65) } else { points[k + 1] };
            hand.push(pen.bone(points[k].to_array(), radius(k), end.to_array(), radius(k + 1)));
        }
    }
    hand
}

fn leg(pen: Pen) -> Vec<Capsule> {
    vec![
        pen.flat([0.086, 0.88, -0.008], 0.088, [0.097, 0.50, -0.002], 0.054, [0.98, 1.0, 1.02]),
        pen.bone([0.090, 0.82, 0.010], 0.076, [0.097, 0.58, 0.008], 0.058), // quadriceps
        pen.bone([0.090, 0.82, -0.020], 0.074, [0.098, 0.58, -0.012], 0.056), // hamstrings
        pen.bone([0.097, 0.52, 0.006], 0.050, [0.099, 0.47, 0.004], 0.046), // knee
        pen.bone([0.098, 0.50, -0.002], 0.054, [0.104, 0.085, -0.028], 0.035),
        pen.bone([0.103, 0.42, -0.014], 0.050, [0.104, 0.25, -0.026], 0.043), // calf
    ]
}

fn foot(pen: Pen) -> Vec<Capsule> {
    let flat = [1.0, 0.72, 1.0];
    vec![
        pen.bone([0.104, 0.10, -0.030], 0.036, [0.104, 0.05, -0.050], 0.037), // heel
        pen.bone([0.104, 0.075, -0.020], 0.038, [0.110, 0.042, 0.070], 0.032), // instep
        pen.flat([0.102, 0.032, -0.045], 0.036, [0.108, 0.026, 0.095], 0.036, flat), // inner sole
        pen.flat([0.112, 0.030, -0.030], 0.034, [0.132, 0.026, 0.080], 0.034, flat), // outer sole
        pen.flat([0.106, 0.026, 0.095], 0.034, [0.112, 0.024, 0.130], 0.030, flat), // toes
    ]
}
