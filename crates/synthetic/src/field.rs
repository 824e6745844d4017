//! Implicit shapes: smooth unions of tapered capsules, with exact gradients.
//!
//! Values are signed distances or smaller in magnitude (the field is 1-Lipschitz), negative inside, so that a block of
//! space whose centre is farther from the surface than its half diagonal holds no surface.

use glam::DVec3;

/// A value of the field and its gradient.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) distance: f64,
    pub(super) gradient: DVec3,
}

/// A tapered capsule: all spheres whose centre and radius go linearly from (`a`, `radius_a`) to (`b`, `radius_b`),
/// stretched by `stretch` per axis about the origin of space scaled likewise (elliptical cross-sections).
#[derive(Clone, Copy, Debug)]
pub(super) struct Capsule {
    a: DVec3,
    axis: DVec3,
    length: f64,
    radius_a: f64,
    /// `(radius_a - radius_b) / length`: the sine of the half opening angle.
    taper: f64,
    stretch: DVec3,
}

impl Capsule {
    /// A round tapered capsule.
    pub(super) fn new(a: DVec3, radius_a: f64, b: DVec3, radius_b: f64) -> Self {
        Self::stretched(a, radius_a, b, radius_b, DVec3::ONE)
    }

    /// A tapered capsule whose radii are multiplied by `stretch` along the axes of space; `a` and `b` stay where they
    /// are.
    pub(super) fn stretched(a: DVec3, radius_a: f64, b: DVec3, radius_b: f64, stretch: DVec3) -> Self {
        let (a, b) = (a / stretch, b / stretch);
        let length = (b - a).length().max(1e-9);
        // One sphere inside the other leaves no cone; keep the taper below 1 so that the formula stays finite.
        let taper = ((radius_a - radius_b) / length).clamp(-0.98, 0.98);
        Self { a, axis: (b - a) / length, length, radius_a, taper, stretch }
    }

    /// The nearest sphere of the family has its centre at `s - taper ρ / √(1 - taper²)` along the axis, clamped to the
    /// segment, for a point at (s, ρ) in cylindrical coordinates.
    fn sample(&self, point: DVec3) -> Sample {
        let offset = point / self.stretch - self.a;
        let along = offset.dot(self.axis);
        let radial = (offset - self.axis * along).length();
        let shift = self.taper * radial / (1.0 - self.taper * self.taper).sqrt();
        let centre = (along - shift).clamp(0.0, self.length);
        let from_centre = offset - self.axis * centre;
        let reach = from_centre.length();
        // In stretched space the distance shrinks by the smallest factor at worst.
        let scale = self.stretch.min_element();
        Sample {
            distance: scale * (reach - (self.radius_a - self.taper * centre)),
            gradient: scale * from_centre / (reach.max(1e-12) * self.stretch),
        }
    }

    fn bounding_sphere(&self) -> (DVec3, f64) {
        let b = self.a + self.axis * self.length;
        let radius = self.radius_a.max(self.radius_a - self.taper * self.length);
        let (a, b) = (self.a * self.stretch, b * self.stretch);
        ((a + b) / 2.0, (b - a).length() / 2.0 + radius * self.stretch.max_element())
    }
}

/// Quadratic smooth minimum: differs from the minimum only where `|a - b| < radius`, by at most `radius / 4`.
fn smooth_min(a: Sample, b: Sample, radius: f64) -> Sample {
    let (near, far) = if a.distance <= b.distance { (a, b) } else { (b, a) };
    // Also true where both are infinite (nothing there).
    let apart = far.distance == f64::INFINITY || far.distance - near.distance >= radius;
    if apart {
        return near;
    }
    let overlap = 1.0 - (far.distance - near.distance) / radius;
    Sample {
        distance: near.distance - overlap * overlap * radius / 4.0,
        gradient: near.gradient.lerp(far.gradient, overlap / 2.0),
    }
}

/// Capsules that melt into each other: a limb, the torso, a hand.
#[derive(Clone, Debug)]
pub(super) struct Part {
    capsules: Vec<Capsule>,
    /// Radius of the smooth union inside the part.
    blend: f64,
    /// Radius of the smooth union with the parts before it.
    join: f64,
    centre: DVec3,
    reach: f64,
}

impl Part {
    /// A part of at least one capsule; `blend` and `join` in metres.
    pub(super) fn new(capsules: Vec<Capsule>, blend: f64, join: f64) -> Self {
        let spheres: Vec<(DVec3, f64)> = capsules.iter().map(Capsule::bounding_sphere).collect();
        let centre = spheres.iter().map(|s| s.0).sum::<DVec3>() / spheres.len().max(1) as f64;
        let reach = spheres.iter().map(|s| (s.0 - centre).length() + s.1).fold(0.0, f64::max);
        // However many members meet, their smooth union lies less than `blend` below the minimum: a sum already that
        // far below the next member is not changed by it.
        Self { reach: reach + blend, capsules, blend, join, centre }
    }

    /// The capsules that matter within `radius` of `centre`: farther ones than twice the blending radius behind the
    /// nearest neither touch it nor anything that does, so that samples there stay the same to the last bit.
    fn near(&self, centre: DVec3, radius: f64, reach_of_union: f64) -> Self {
        let (nearest, reach) = (self.sample(centre).distance, 2.0 * (radius + self.blend));
        let matters = nearest < reach_of_union + 2.0 * (radius + self.join);
        let near = |capsule: &&Capsule| matters && capsule.sample(centre).distance < nearest + reach;
        Self { capsules: self.capsules.iter().filter(near).copied().collect(), ..*self }
    }

    fn sample(&self, point: DVec3) -> Sample {
        let mut samples = self.capsules.iter().map(|c| c.sample(point));
        let Some(first) = samples.next() else {
            return Sample { distance: f64::INFINITY, gradient: DVec3::ZERO };
        };
        samples.fold(first, |sum, next| smooth_min(sum, next, self.blend))
    }
}

/// A smooth union of parts, cut flat at a floor.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) parts: Vec<Part>,
    /// Height of the flat sole, if the shape stands on one, and the radius of its rounded edge.
    pub(super) floor: Option<(f64, f64)>,
}

impl Field {
    /// The smooth union of the parts, without the floor.
    fn union(&self, point: DVec3) -> Sample {
        let mut sum = Sample { distance: f64::INFINITY, gradient: DVec3::ZERO };
        for part in &self.parts {
            // Beyond the blending radius a part changes nothing: skipping it is exact.
            if (point - part.centre).length() - part.reach < sum.distance + part.join {
                sum = smooth_min(part.sample(point), sum, part.join);
            }
        }
        sum
    }

    /// The signed distance bound and its gradient.
    pub(super) fn sample(&self, point: DVec3) -> Sample {
        let sum = self.union(point);
        let Some((height, radius)) = self.floor else { return sum };
        let flip = |s: Sample| Sample { distance: -s.distance, gradient: -s.gradient };
        let below = Sample { distance: height - point.y, gradient: -DVec3::Y };
        flip(smooth_min(flip(sum), flip(below), radius))
    }

    /// The same field within `radius` of `centre`, made of fewer capsules.
    pub(super) fn near(&self, centre: DVec3, radius: f64) -> Self {
        let nearest = self.union(centre).distance;
        Self {
            parts: self.parts.iter().map(|p| p.near(centre, radius, nearest)).collect(),
            floor: self.floor,
        }
    }

    /// The signed distance bound.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        self.sample(point).distance
    }

    /// Index of the part whose surface is nearest.
    pub(super) fn nearest_part(&self, point: DVec3) -> usize {
        let distances = self.parts.iter().map(|part| part.sample(point).distance);
        distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i)
    }

    /// A box that holds the surface.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let low = self.parts.iter().map(|p| p.centre - p.reach).fold(DVec3::INFINITY, DVec3::min);
        let high = self.parts.iter().map(|p| p.centre + p.reach).fold(DVec3::NEG_INFINITY, DVec3::max);
        (low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn field() -> Field {
        let bone = Capsule::new(DVec3::ZERO, 0.1, DVec3::Y, 0.05);
        let flat = DVec3::new(1.0, 0.6, 1.3);
        let palm = Capsule::stretched(DVec3::Y, 0.1, DVec3::ONE, 0.12, flat);
        Field {
            parts: vec![Part::new(vec![bone, palm], 0.05, 0.03), Part::new(vec![bone], 0.1, 0.1)],
            floor: Some((-0.05, 0.02)),
        }
    }

    #[test]
    fn a_capsule_is_the_hull_of_its_spheres() {
        let capsule = Capsule::new(DVec3::ZERO, 0.3, DVec3::X * 2.0, 0.1);
        assert!((capsule.sample(DVec3::new(-1.0, 0.0, 0.0)).distance - 0.7).abs() < 1e-12);
        assert!((capsule.sample(DVec3::new(3.0, 0.0, 0.0)).distance - 0.9).abs() < 1e-12);
        let point = DVec3::new(0.8, 0.5, -0.2);
        let nearest = |t: f64| (point - DVec3::X * t).length() - (0.3 - 0.1 * t);
        let brute = (0..=20_000).map(|i| nearest(f64::from(i) * 1e-4)).fold(f64::INFINITY, f64::min);
        assert!((capsule.sample(point).distance - brute).abs() < 1e-8);
    }

    proptest! {
        #[test]
        fn a_local_field_is_the_field_to_the_last_bit(
            c in prop::array::uniform3(-1.0f64..2.0), o in prop::array::uniform3(-1.0f64..1.0), radius in 0.01f64..0.6
        ) {
            let (field, centre) = (field(), DVec3::from_array(c));
            let point = centre + DVec3::from_array(o).clamp_length_max(1.0) * radius * 0.999;
            let (whole, local) = (field.sample(point), field.near(centre, radius).sample(point));
            prop_assert_eq!(whole.distance.to_bits(), local.distance.to_bits());
            prop_assert_eq!(whole.gradient, local.gradient);
        }

        #[test]
        fn the_gradient_is_the_derivative_and_at_most_one(x in -1.0f64..2.0, y in -1.0f64..2.0, z in -1.0f64..2.0) {
            let (field, p) = (field(), DVec3::new(x, y, z));
            let h = 1e-6;
            let slope = |e: DVec3| (field.distance(p + e * h) - field.distance(p - e * h)) / (2.0 * h);
            let numeric = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
            let gradient = field.sample(p).gradient;
            prop_assert!(gradient.length() <= 1.0 + 1e-12);
            // The derivative itself jumps where two spheres of a family change places, never by more than 2.
            prop_assert!((numeric - gradient).length() < 1e-4 || numeric.length() < 1.0 - 1e-6, "{numeric} {gradient}");
        }
    }
}
