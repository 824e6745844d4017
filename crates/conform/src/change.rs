//! The catalogue of bugs: one change of one stage each, with the name under which it is reported.

use super::wiring::{
    Activation, Angles, Axes, Basis, Blend, Covariance, Frames, Influences, JointMatrices, Order, Product,
    Scale, ShLayout, Turn, Turned, Unit, Wiring,
};
use crate::blends::{blends, details_of_blend, kind_of_blend, summary_of_blend};
use serde_json::{Value, json};

/// What may be wrong at one stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    Angles(Angles),
    Frames(Frames),
    BindMissing,
    JointMatrices(JointMatrices),
    /// As [`JointMatrices::Transposed3`], under the name of what causes it.
    RowMajor(JointMatrices),
    JointQuaternions(Order),
    Influences(Influences),
    KeepsSum,
    Canonical(Order),
    Blend(Blend),
    Unit(Unit),
    Relative(Inverse),
    Product(Product),
    Posed(Inverse),
    Scale(Scale),
    Covariance(Covariance),
    /// Bands of SH that are turned otherwise, and whether the view direction is too.
    Turned {
        bands: [bool; 3],
        direction: bool,
        turn: Turn,
    },
    DirectionReversed,
    Basis(Basis),
    Mirror(usize),
    Axes(Axes),
    Order(Order),
    Units(f64),
    Opacity(Activation),
    Layout(ShLayout),
}

/// One thing by two names: R(q̄) = R(q)ᵀ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Inverse {
    Conjugated,
    Transposed,
}

/// Units that files come in, per metre, with their names.
const UNITS: [(f64, &str); 5] = [
    (100.0, "centimetres"),
    (1000.0, "millimetres"),
    (0.01, "hundreds of metres"),
    (0.001, "kilometres"),
    (39.370_078_740_157_48, "inches"),
];

impl Change {
    /// Every single change.
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![
            Self::Angles(Angles::TakenForDegrees),
            Self::Angles(Angles::HandedInDegrees),
            Self::Frames(Frames::LateFromRest),
            Self::Frames(Frames::LateHeld),
            Self::Frames(Frames::LateAround),
            Self::BindMissing,
            Self::JointQuaternions(Order::WLast),
            Self::JointQuaternions(Order::WFirst),
            Self::Canonical(Order::WLast),
            Self::Canonical(Order::WFirst),
            Self::Order(Order::WLast),
            Self::Order(Order::WFirst),
            Self::KeepsSum,
            Self::Unit(Unit::Raw),
            Self::Unit(Unit::RawMatrix),
            Self::Product(Product::Swapped),
            Self::Product(Product::NotTurned),
            Self::Product(Product::CanonicalForgotten),
            Self::Covariance(Covariance::Blended),
            Self::Covariance(Covariance::NotSquared),
            Self::DirectionReversed,
            Self::Opacity(Activation::Twice),
            Self::Opacity(Activation::Never),
            Self::Layout(ShLayout::Planar),
            Self::Layout(ShLayout::Interleaved),
            Self::Layout(ShLayout::OrdersReversed),
        ];
        all.extend(
            [JointMatrices::Transposed3, JointMatrices::Transposed3MeansOnly].map(Self::JointMatrices),
        );
        all.extend(
            [
                JointMatrices::Transposed3,
                JointMatrices::Transposed3MeansOnly,
                JointMatrices::Transposed4,
                JointMatrices::Transposed4MeansOnly,
            ]
            .map(Self::RowMajor),
        );
        all.extend((1..=5).map(|n| Self::Influences(Influences::CutTo(n))));
        all.extend([15, 255].map(|levels| Self::Influences(Influences::Levels(levels))));
        for name in [Inverse::Conjugated, Inverse::Transposed] {
            all.extend([Self::Relative(name), Self::Posed(name)]);
        }
        all.extend(blends().into_iter().map(Self::Blend));
        let scales = [Scale::Ones, Scale::GeometricBall, Scale::ArithmeticBall, Scale::Twice, Scale::Never];
        all.extend(scales.map(Self::Scale));
        all.extend(turns());
        let named = [Basis::OddOrders, Basis::Axis(0), Basis::Axis(1), Basis::Axis(2)];
        all.extend(named.into_iter().chain((1..16).map(Basis::One)).map(Self::Basis));
        all.extend((0..3).map(Self::Mirror));
        for turned in [Turned::YToZ, Turned::ZToY, Turned::Half] {
            all.extend([Axes::World(turned), Axes::Both(turned)].map(Self::Axes));
        }
        all.extend(UNITS.map(|(factor, _)| Self::Units(factor)));
        all
    }

    /// Makes the change.
    pub(crate) fn apply(&self, wiring: &mut Wiring) {
        match *self {
            Self::Angles(angles) => wiring.angles = angles,
            Self::Frames(frames) => wiring.frames = frames,
            Self::BindMissing => wiring.bind_is_missing = true,
            Self::JointMatrices(matrices) | Self::RowMajor(matrices) => wiring.joint_matrices = matrices,
            Self::JointQuaternions(order) => wiring.joint_quaternions = order,
            Self::Influences(influences) => wiring.influences = influences,
            Self::KeepsSum => wiring.keeps_sum = true,
            Self::Canonical(order) => wiring.canonical = order,
            Self::Blend(blend) => wiring.blend = blend,
            Self::Unit(unit) => wiring.unit = unit,
            Self::Relative(_) => wiring.relative_is_inverted = true,
            Self::Product(product) => wiring.product = product,
            Self::Posed(_) => wiring.posed_is_inverted = true,
            Self::Scale(scale) => wiring.scale = scale,
            Self::Covariance(covariance) => wiring.covariance = covariance,
            Self::Turned { bands, direction, turn } => {
                for (own, _) in wiring.sh.iter_mut().zip(bands).filter(|(_, band)| *band) {
                    *own = turn;
                }
                if direction {
                    wiring.direction = turn;
                }
            }
            Self::DirectionReversed => wiring.direction_is_reversed = true,
            Self::Basis(basis) => wiring.basis = basis,
            Self::Mirror(axis) => wiring.mirror = Some(axis),
            Self::Axes(axes) => wiring.axes = axes,
            Self::Order(order) => wiring.order = order,
            Self::Units(factor) => wiring.units = Some(factor),
            Self::Opacity(opacity) => wiring.opacity = opacity,
            Self::Layout(layout) => wiring.layout = layout,
        }
    }

    /// True if both change the same stage, so that they cannot be combined.
    pub(crate) fn excludes(&self, other: &Self) -> bool {
        let stage = |change: &Self| match change {
            Self::RowMajor(matrices) => std::mem::discriminant(&Self::JointMatrices(*matrices)),
            other => std::mem::discriminant(other),
        };
        stage(self) == stage(other)
    }

    /// Its name in reports.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Angles(_) => "degrees-for-radians",
            Self::Frames(_) => "one-frame-late",
            Self::BindMissing => "bind-pose-missing",
            Self::JointMatrices(_) => "transposed",
            Self::RowMajor(_) => "row-major-matrices",
            Self::JointQuaternions(_) | Self::Canonical(_) | Self::Order(_) => "xyzw-for-wxyz",
            Self::Influences(Influences::CutTo(count)) => {
                ["weights-cut-to-one", "weights-cut-to-two", "weights-cut-to-three", "weights-cut-to-four"]
                    .get(count - 1)
                    .copied()
                    .unwrap_or("weights-cut-to-five")
            }
            Self::Influences(_) => "weights-quantised",
            Self::KeepsSum => "weights-not-normalised",
            Self::Blend(blend) => kind_of_blend(blend),
            Self::Unit(_) => "not-normalised",
            Self::Relative(Inverse::Conjugated) | Self::Posed(Inverse::Conjugated) => "conjugated",
            Self::Relative(Inverse::Transposed) | Self::Posed(Inverse::Transposed) => "transposed",
            Self::Product(Product::Swapped) => "product-swapped",
            Self::Product(Product::CanonicalForgotten) => "canonical-rotation-missing",
            Self::Product(_) => "gaussians-not-turned",
            Self::Scale(Scale::Twice) => "activated-scale",
            Self::Scale(Scale::Never) => "scale-not-activated",
            Self::Scale(_) => "scale-ignored",
            Self::Covariance(Covariance::NotSquared) => "scale-not-squared",
            Self::Covariance(_) => "blended-matrix-not-projected",
            Self::Turned { turn: Turn::Backwards, .. } => "sh-turned-backwards",
            Self::Turned { .. } => "sh-not-turned",
            Self::DirectionReversed => "direction-reversed",
            Self::Basis(_) => "sh-basis-sign",
            Self::Mirror(_) => "mirrored-handedness",
            Self::Axes(Axes::World(Turned::Half) | Axes::Both(Turned::Half)) => "y-down-for-y-up",
            Self::Axes(_) => "y-up-for-z-up",
            Self::Units(_) => "other-units",
            Self::Opacity(Activation::Never) => "opacity-not-activated",
            Self::Opacity(_) => "activated-opacity",
            Self::Layout(_) => "sh-order",
        }
    }

    /// What a program may want to know besides the kind.
    pub(crate) fn details(&self) -> Value {
        match self {
            Self::Angles(angles) => json!({ "factor": match angles {
                Angles::HandedInDegrees => "180/pi",
                _ => "pi/180",
            } }),
            Self::Frames(frames) => json!({ "first_pose": match frames {
                Frames::LateFromRest => "rest",
                Frames::LateHeld => "itself",
                _ => "last",
            } }),
            Self::RowMajor(JointMatrices::Transposed4 | JointMatrices::Transposed4MeansOnly) => {
                json!({ "translation": "lost" })
            }
            Self::JointMatrices(_) | Self::RowMajor(_) => json!({ "of": "joint matrices" }),
            Self::JointQuaternions(_) => json!({ "of": "joint quaternions" }),
            Self::Canonical(_) => json!({ "of": "canonical rotations" }),
            Self::Order(_) => json!({ "of": "answer" }),
            Self::Influences(Influences::CutTo(count)) => json!({ "influences": count }),
            Self::Influences(Influences::Levels(levels)) => json!({ "levels": levels }),
            Self::Blend(blend) => details_of_blend(blend),
            Self::Relative(_) => json!({ "of": "relative rotation" }),
            Self::Posed(_) => json!({ "of": "posed rotation" }),
            Self::Turned { bands, direction, .. } => {
                let named: Vec<usize> = (1..4).filter(|l| bands[l - 1]).collect();
                json!({ "bands": named, "view_direction": direction })
            }
            Self::Basis(basis) => {
                let flipped: Vec<usize> =
                    (1..16).filter(|&k| super::pipeline::is_flipped(*basis, k)).collect();
                json!({ "coefficients": flipped, "where": "while turning" })
            }
            Self::Mirror(axis) => json!({ "axis": axis_name(*axis) }),
            Self::Axes(axes) => json!({ "answer_is": match axes {
                Axes::World(Turned::YToZ) | Axes::Both(Turned::YToZ) => "z up: (x, -z, y)",
                Axes::World(Turned::Half) | Axes::Both(Turned::Half) => "y down: (x, -y, -z)",
                _ => "y from z: (x, z, -y)",
            } }),
            Self::Units(factor) => {
                let name = UNITS.iter().find(|(known, _)| known == factor).map_or("", |(_, name)| name);
                json!({ "per_metre": factor, "unit": name })
            }
            Self::Scale(scale) => json!({ "drawn_as": match scale {
                Scale::Ones => "1 along each axis",
                Scale::GeometricBall => "balls of the geometric mean",
                Scale::ArithmeticBall => "balls of the arithmetic mean",
                Scale::Twice => "exp of the standard deviation",
                _ => "logarithms",
            } }),
            Self::Layout(layout) => json!({ "order": match layout {
                ShLayout::Planar => "channel by channel",
                ShLayout::Interleaved => "coefficient by coefficient",
                _ => "m from l to -l",
            } }),
            _ => json!({}),
        }
    }

    /// What it is, in a sentence for people.
    pub(crate) fn summary(&self) -> String {
        let text = match self {
            Self::Angles(Angles::HandedInDegrees) => {
                "pose angles were multiplied by 180/pi and used as radians"
            }
            Self::Angles(_) => "pose angles are radians and were read as degrees: multiplied by pi/180",
            Self::Frames(_) => "the answer to a pose is that of the pose before",
            Self::BindMissing => {
                "means were moved by the joints' world matrices, without the inverse bind matrices"
            }
            Self::JointMatrices(_) => "the 3x3 part of the joint matrices is transposed",
            Self::RowMajor(JointMatrices::Transposed4 | JointMatrices::Transposed4MeansOnly) => {
                "joint matrices were read in the other order (rows for columns): transposed, their translation lost"
            }
            Self::RowMajor(_) => {
                "the 3x3 part of the joint matrices was read in the other order (rows for columns)"
            }
            Self::JointQuaternions(_) => "the joints' quaternions were read with w at the other end",
            Self::Canonical(_) => "the canonical quaternions were read with w at the other end",
            Self::Order(_) => "the quaternions of the answer have w at the other end",
            Self::Influences(Influences::CutTo(count)) => {
                return format!("only the heaviest {count} joint(s) of each Gaussian count");
            }
            Self::Influences(Influences::Levels(levels)) => {
                return format!("weights were rounded to {levels} levels");
            }
            Self::Influences(_) => "weights were changed",
            Self::KeepsSum => "weights do not sum to one and were not divided by their sum",
            Self::Blend(blend) => return summary_of_blend(blend),
            Self::Unit(_) => "the sum of the joints' quaternions was not normalised",
            Self::Relative(Inverse::Conjugated) => {
                "the blended rotation is conjugated: Gaussians turn backwards"
            }
            Self::Relative(Inverse::Transposed) => {
                "the blended rotation is transposed: Gaussians turn backwards"
            }
            Self::Posed(Inverse::Conjugated) => "the posed quaternion is conjugated",
            Self::Posed(Inverse::Transposed) => "the posed rotation matrix is transposed",
            Self::Product(Product::Swapped) => {
                "canonical and blended rotation are multiplied in the wrong order"
            }
            Self::Product(Product::CanonicalForgotten) => {
                "the canonical rotation of the Gaussians is left out"
            }
            Self::Product(_) => "Gaussians were moved and not turned",
            Self::Scale(Scale::Twice) => {
                "activated standard deviations stand where logarithms belong (or exp was applied twice)"
            }
            Self::Scale(Scale::Never) => {
                "logarithms stand where standard deviations belong (exp was not applied)"
            }
            Self::Scale(_) => "the Gaussians' scales are ignored",
            Self::Covariance(Covariance::NotSquared) => {
                "the covariance holds standard deviations where variances belong"
            }
            Self::Covariance(_) => "the covariance was deformed by the blended matrix, which is no rotation",
            Self::Turned { turn: Turn::Backwards, .. } => {
                "SH (or view directions) are turned by the inverse rotation"
            }
            Self::Turned { .. } => "SH (or view directions) are not turned with the Gaussians",
            Self::DirectionReversed => {
                "view directions point from the Gaussian to the camera: camera minus mean in place of mean minus camera"
            }
            Self::Basis(_) => "SH were turned in a basis with other signs",
            Self::Mirror(_) => "the answer is mirrored: its axes have the other handedness",
            Self::Axes(Axes::World(Turned::Half) | Axes::Both(Turned::Half)) => {
                "y points down where it should point up"
            }
            Self::Axes(_) => "y up and z up are mixed up",
            Self::Units(_) => "lengths are in another unit",
            Self::Opacity(Activation::Never) => {
                "logits stand where opacities belong (the sigmoid was not applied)"
            }
            Self::Opacity(_) => {
                "activated opacities stand where logits belong (or the sigmoid was applied twice)"
            }
            Self::Layout(_) => "SH coefficients are in another order",
        };
        text.to_owned()
    }
}

fn axis_name(axis: usize) -> &'static str {
    ["x", "y", "z"].get(axis).copied().unwrap_or_default()
}

fn turns() -> Vec<Change> {
    let mut all = Vec::new();
    for turn in [Turn::Not, Turn::Backwards] {
        for mask in 0..8u8 {
            let bands = [0, 1, 2].map(|l| mask & (1 << l) != 0);
            // The direction is turned or not as a whole: with all bands, or alone.
            for direction in [false, true] {
                if (mask > 0 || direction) && (!direction || mask == 0 || mask == 7) {
                    all.push(Change::Turned { bands, direction, turn });
                }
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::pipeline::Pipeline;
    use super::super::sample::{Field, Sample, Storage, error, range};
    use super::super::{Cases, Convention, Rig};
    use super::*;

    /// Names of one thing.
    const TWINS: [[&str; 2]; 2] = [["conjugated", "transposed"], ["row-major-matrices", "transposed"]];

    fn differ(a: &[Sample], b: &[Sample]) -> bool {
        let off = |a: &Sample, b: &Sample| {
            Field::ALL
                .into_iter()
                .any(|field| error(field, Storage::Activated, 1.0, &a[range(field)], &b[range(field)]) > 2e-4)
        };
        a.iter().zip(b).any(|(a, b)| off(a, b))
    }

    /// The rig tells every bug from the right answer and from every other bug.
    #[test]
    fn no_two_bugs_look_alike() {
        let rig = Rig::new(Cases::Small).unwrap();
        let pipeline = Pipeline { rig: &rig, convention: Convention::default(), storage: Storage::Activated };
        let outputs = |change: Option<&Change>| -> Vec<Sample> {
            let mut wiring = Wiring::default();
            change.iter().for_each(|change| change.apply(&mut wiring));
            (0..rig.poses.len()).flat_map(|frame| pipeline.frame(&wiring, frame)).collect()
        };
        let right = outputs(None);
        let seen: Vec<(Change, Vec<Sample>)> =
            Change::all().into_iter().map(|change| (change, outputs(Some(&change)))).collect();
        let mut alike = Vec::new();
        for (i, (a, of_a)) in seen.iter().enumerate() {
            // Weights sum to one here: that they were kept is seen only together with a cut.
            if differ(of_a, &right) == (*a == Change::KeepsSum) {
                alike.push(format!("{a:?} and the right answer"));
            }
            for (b, of_b) in &seen[i + 1..] {
                let mut kinds = [a.kind(), b.kind()];
                kinds.sort_unstable();
                if kinds[0] != kinds[1] && !TWINS.contains(&kinds) && !differ(of_a, of_b) {
                    alike.push(format!("{a:?} and {b:?}"));
                }
            }
        }
        assert!(alike.is_empty(), "{alike:#?}");
    }
}
