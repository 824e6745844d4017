//! What the surface looks like, as a function of the position on the reference body: regions of skin, hair and cloth
//! with sharp patterns at several scales, which a splat that is turned the wrong way smears.

use super::lighting::{Finish, to_linear};
use super::noise;
use super::parameters::{Look, Pattern};
use super::skeleton::{ARM_Y, ARM_Z};
use glam::{Vec2, Vec3};
use skinsplat_core::math::portable;
use std::f32::consts::TAU;
use std::sync::LazyLock;

/// Colours and patterns of a subject.
#[derive(Clone, Debug)]
pub(super) struct Material {
    look: Look,
    seed: u32,
    shirt: [Vec3; 3],
    trousers: [Vec3; 2],
    skin: Vec3,
    hair: Vec3,
}

// Asked for at every sample, and a power each to make.
static WHITE: LazyLock<Vec3> = LazyLock::new(|| to_linear([0.93, 0.92, 0.90]));
static DARK: LazyLock<Vec3> = LazyLock::new(|| to_linear([0.09, 0.09, 0.10]));
static BUCKLE: LazyLock<Vec3> = LazyLock::new(|| to_linear([0.78, 0.70, 0.45]));
static LEATHER: LazyLock<Vec3> = LazyLock::new(|| to_linear([0.25, 0.15, 0.09]));

impl Material {
    pub(super) fn new(look: Look, seed: u32) -> Self {
        let hue = look.hue as f32;
        let trousers = look.trousers_hue as f32;
        let between = |a: [f32; 3], b: [f32; 3], t: f64| to_linear(a).lerp(to_linear(b), t as f32);
        Self {
            look,
            seed,
            shirt: [to_linear(hsv(hue, 0.72, 0.80)), *WHITE, to_linear(hsv(hue + 35.0, 0.85, 0.35))],
            trousers: [to_linear(hsv(trousers, 0.55, 0.42)), to_linear(hsv(trousers, 0.30, 0.72))],
            skin: between([0.36, 0.22, 0.16], [0.94, 0.76, 0.66], look.skin),
            hair: between([0.07, 0.05, 0.05], [0.80, 0.62, 0.38], look.hair),
        }
    }

    /// The figure at a point of the reference adult.
    pub(super) fn figure(&self, p: Vec3) -> Finish {
        let out = p.x.abs();
        // The armhole runs from the shoulder into the armpit.
        if out > 0.155 && 0.6 * (out - 0.155) + 0.8 * (p.y - 1.335) > 0.0 {
            return if out > 0.665 { self.hand(p) } else { self.sleeve(p) };
        }
        // The collar lies lower in front than behind.
        let collar = p.y - 1.470 + 0.25 * p.z;
        match p.y {
            _ if collar > 0.012 => self.head(p),
            _ if collar > 0.0 => self.cloth(self.shirt[2], p, 0.7),
            y if y > 0.965 => self.torso(p),
            y if y > 0.935 => self.belt(p),
            y if y > 0.118 => self.trouser_leg(p),
            y if y > 0.105 && p.z < 0.05 => self.cloth(*WHITE, p, 0.8),
            _ => self.shoe(p),
        }
    }

    /// An arm of bones at a point: bands along it, marks around it. `along` in bones, `around` in radians.
    pub(super) fn arm(&self, p: Vec3, along: f32, around: f32) -> Finish {
        let bone = along.floor();
        let base = if bone.rem_euclid(2.0) < 1.0 { self.shirt[0] } else { self.trousers[1] };
        // A whole number of repeats closes the pattern around the tube.
        let repeats = (6.0 / self.look.pattern_scale as f32).round().max(1.0);
        let lattice = Vec2::new(along * 6.0 / self.look.pattern_scale as f32, around / TAU * repeats);
        let mut colour = self.pattern(lattice, [base, self.shirt[1], self.shirt[2]]);
        if (along - bone - 0.5).abs() > 0.485 {
            colour = *DARK;
        }
        if (around / TAU).abs() < 0.02 {
            colour = self.shirt[2];
        }
        self.finish(colour, p, 90.0, 0.45)
    }

    /// Cloth of one colour: a weave and slow variations.
    fn cloth(&self, colour: Vec3, p: Vec3, roughness: f32) -> Finish {
        let weave = noise::value(p * 420.0, self.seed ^ 11) - 0.5;
        let finish = self.finish(colour, p, 26.0, roughness);
        Finish { albedo: finish.albedo * (1.0 + 0.35 * self.contrast() * weave), ..finish }
    }

    /// A colour with noise of a spatial frequency (1/m), and the gloss of the look.
    fn finish(&self, colour: Vec3, p: Vec3, frequency: f32, roughness: f32) -> Finish {
        let mottled = 1.0 + 0.5 * self.contrast() * (noise::fractal(p * frequency, self.seed) - 0.5);
        let gloss = self.look.gloss as f32;
        Finish {
            albedo: (colour * mottled).clamp(Vec3::ZERO, Vec3::splat(0.95)),
            roughness: (roughness * (1.4 - 0.4 * gloss)).clamp(0.15, 1.0),
            reflectance: 0.045 * gloss,
        }
    }

    fn contrast(&self) -> f32 {
        self.look.contrast as f32
    }

    /// Pulls a colour towards the plain one as the contrast falls.
    fn contrasted(&self, colour: Vec3, plain: Vec3) -> Vec3 {
        plain.lerp(colour, self.contrast())
    }

    /// The cloth's pattern at lattice coordinates (one unit per repeat): base, second and accent colour.
    fn pattern(&self, at: Vec2, [base, second, accent]: [Vec3; 3]) -> Vec3 {
        let fraction = at - at.floor();
        let colour = match self.look.pattern {
            Pattern::Stripes => match fraction.x {
                x if x < 0.46 => base,
                x if (0.68..0.78).contains(&x) => accent,
                _ => second,
            },
            Pattern::Checks => {
                let board = |v: Vec2| (v.floor().element_sum().rem_euclid(2.0)) < 0.5;
                match (board(at * 2.0), board(at * 8.0)) {
                    (true, _) => base,
                    (false, true) => second,
                    (false, false) => accent.lerp(second, 0.4),
                }
            }
            Pattern::Dots => {
                let row = (at.x * 2.0).floor();
                let shifted = Vec2::new(at.x * 2.0, at.y * 2.0 + 0.5 * row.rem_euclid(2.0));
                let radius = (shifted - shifted.floor() - 0.5).length();
                match radius {
                    r if r < 0.16 => accent,
                    r if r < 0.34 => second,
                    _ => base,
                }
            }
            Pattern::Plaid => {
                let band = |x: f32| f32::from(x < 0.45) + f32::from((0.68..0.76).contains(&x));
                let (rows, columns) = (band(fraction.x), band(fraction.y));
                base.lerp(second, 0.5 * rows).lerp(accent, 0.45 * columns)
            }
        };
        self.contrasted(colour, base.lerp(second, 0.4))
    }

    /// Repeats per metre along a limb.
    fn rate(&self) -> f32 {
        20.0 / self.look.pattern_scale as f32
    }

    fn torso(&self, p: Vec3) -> Finish {
        // Along the surface from the middle to the flanks: across in front and behind, backwards at the sides.
        let arc = p.x.abs() - 0.7 * p.z;
        let mut colour = self.pattern(Vec2::new(p.y, arc) * self.rate(), self.shirt);
        if p.z > 0.0 {
            colour = self.emblem(Vec2::new(p.x, p.y - 1.27) / 0.075, colour);
        } else {
            colour = self.arrow(Vec2::new(p.x, p.y - 1.24) / 0.11, colour);
        }
        self.cloth(colour, p, 0.62)
    }

    /// Rings with a cross on the chest.
    fn emblem(&self, at: Vec2, cloth: Vec3) -> Vec3 {
        let radius = at.length();
        let spokes = (portable::atan2(at.y, at.x) * 6.0 / TAU).rem_euclid(1.0) < 0.5;
        match radius {
            r if r > 1.0 => cloth,
            r if r > 0.86 => self.contrasted(*DARK, cloth),
            r if r > 0.45 => self.contrasted(if spokes { self.shirt[2] } else { *WHITE }, cloth),
            r if r > 0.36 => self.contrasted(*DARK, cloth),
            _ => self.contrasted(self.trousers[1], cloth),
        }
    }

    /// Chevrons on the back, which tell up from down and left from right.
    fn arrow(&self, at: Vec2, cloth: Vec3) -> Vec3 {
        let chevron = at.y + at.x.abs() * 0.8;
        if at.x.abs() < 0.9
            && at.y.abs() < 1.0
            && (chevron * 2.2).rem_euclid(1.0) < 0.42
            && chevron.abs() < 0.9
        {
            let ink = if at.x > 0.0 { self.shirt[2] } else { *DARK };
            return self.contrasted(ink, cloth);
        }
        cloth
    }

    fn sleeve(&self, p: Vec3) -> Finish {
        let out = p.x.abs();
        if !(0.160..=0.640).contains(&out) {
            return self.cloth(self.shirt[2], p, 0.62);
        }
        let around = portable::atan2(p.y - ARM_Y as f32, p.z - ARM_Z as f32) / TAU;
        let repeats = (6.0 / self.look.pattern_scale as f32).round().max(1.0);
        let mut colour = self.pattern(Vec2::new(out * self.rate(), around * repeats), self.shirt);
        // A line along the outside shows twists.
        if (around - 0.25).abs() < 0.035 {
            colour = self.contrasted(*DARK, colour);
        }
        self.cloth(colour, p, 0.62)
    }

    fn belt(&self, p: Vec3) -> Finish {
        if p.z > 0.0 && p.x.abs() < 0.028 {
            return self.finish(*BUCKLE, p, 60.0, 0.28);
        }
        self.finish(*LEATHER, p, 60.0, 0.38)
    }

    fn trouser_leg(&self, p: Vec3) -> Finish {
        let axis = Vec2::new(0.098 * p.x.signum(), -0.01);
        let around = portable::atan2((p.x - axis.x) * p.x.signum(), p.z - axis.y) / TAU;
        let [base, light] = self.trousers;
        let knee = Vec2::new(around / 0.11, (p.y - 0.50) / 0.06).abs().max_element() < 1.0;
        let fine = (p.y * 110.0).floor() + (around * 64.0).floor();
        let colour = match () {
            () if (around - 0.25).abs() < 0.022 => *WHITE,
            () if (around - 0.25).abs() < 0.045 => self.shirt[0],
            () if knee => {
                if fine.rem_euclid(2.0) < 0.5 {
                    light
                } else {
                    base * 0.5
                }
            }
            () if (around * 26.0).rem_euclid(1.0) < 0.14 && p.y < 0.86 => light,
            () if (p.y - 0.14).abs() < 0.006 => light,
            () => base,
        };
        self.cloth(self.contrasted(colour, base), p, 0.5)
    }

    fn shoe(&self, p: Vec3) -> Finish {
        let lace = p.y > 0.055 && (0.0..0.075).contains(&p.z) && (p.x.abs() - 0.108).abs() < 0.022;
        let colour = match () {
            () if p.y < 0.022 => *WHITE,
            () if lace && (p.z * 75.0).rem_euclid(1.0) < 0.45 => *WHITE,
            () if p.z > 0.095 => self.trousers[0],
            () => self.shirt[0] * 0.55,
        };
        self.finish(colour, p, 80.0, 0.3)
    }

    fn hand(&self, p: Vec3) -> Finish {
        // A strap around the wrist and darker creases at the knuckles.
        if p.x.abs() < 0.685 {
            return self.finish(*DARK, p, 200.0, 0.35);
        }
        let crease = 1.0 - 0.12 * self.contrast() * f32::from((p.x.abs() * 55.0).rem_euclid(1.0) < 0.12);
        self.finish(self.skin * crease, p, 130.0, 0.42)
    }

    fn head(&self, p: Vec3) -> Finish {
        let ear = p.x.abs() > 0.087 && p.y < 1.67;
        // The hairline falls from the forehead to the nape, with a parting of its own on the left.
        let hairline = 1.612 + 0.80 * p.z - 0.012 * portable::sin(p.x * 30.0);
        if p.y > hairline && !ear && p.y > 1.535 {
            let strands = noise::fractal(Vec3::new(p.x * 260.0, p.y * 26.0, p.z * 60.0), self.seed ^ 5);
            let colour = self.hair * (1.0 + 1.3 * self.contrast() * (strands - 0.5));
            return self.finish(colour, p, 40.0, 0.36);
        }
        let mut finish = self.finish(self.skin, p, 120.0, 0.42);
        if p.z > 0.055 {
            finish = self.face(p, finish);
        }
        finish
    }

    /// Eyes, brows, lips and warm cheeks.
    fn face(&self, p: Vec3, skin: Finish) -> Finish {
        let ellipse =
            |x: f32, y: f32, rx: f32, ry: f32| Vec2::new((p.x.abs() - x) / rx, (p.y - y) / ry).length();
        let painted = |colour: Vec3, roughness| Finish {
            albedo: self.contrasted(colour, skin.albedo),
            roughness,
            ..skin
        };
        let eye = ellipse(0.033, 1.634, 0.0125, 0.0062);
        if eye < 1.0 {
            return match ellipse(0.033, 1.634, 1.0, 1.0) {
                r if r < 0.0026 => painted(Vec3::splat(0.01), 0.15),
                r if r < 0.0056 => painted(self.trousers[1] * 0.7, 0.15),
                _ => painted(Vec3::splat(0.80), 0.2),
            };
        }
        if eye < 1.25 || ellipse(0.035, 1.6575 - 0.15 * (p.x.abs() - 0.03), 0.021, 0.0042) < 1.0 {
            return painted(self.hair * 0.6, 0.5);
        }
        // A faint smile: the corners are higher than the middle.
        let mouth = 1.5645 + 7.0 * p.x * p.x;
        if ellipse(0.0, mouth, 0.024, 0.0065) < 1.0 {
            let line = (p.y - mouth).abs() < 0.0009;
            return painted(self.skin * Vec3::new(0.85, 0.50, 0.47) * if line { 0.3 } else { 1.0 }, 0.3);
        }
        let blush = (1.0 - ellipse(0.040, 1.603, 0.026, 0.020)).max(0.0);
        Finish { albedo: skin.albedo * Vec3::ONE.lerp(Vec3::new(1.02, 0.80, 0.78), blush), ..skin }
    }
}

/// Hue in degrees, saturation and value to sRGB values.
fn hsv(hue: f32, saturation: f32, value: f32) -> [f32; 3] {
    [5.0, 3.0, 1.0].map(|offset: f32| {
        let k = (offset + hue / 60.0).rem_euclid(6.0);
        value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}
