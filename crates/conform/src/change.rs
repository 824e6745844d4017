//! The catalogue of bugs: one change of one stage each.

use super::blends::blends;
use super::convention::Convention;
use super::wiring::{
    Activation, Angles, Axes, Basis, Bind, Blend, Covariance, Frames, Influences, JointMatrices, Order,
    Product, Reading, Scale, ShLayout, Space, Translation, Turn, Turned, Unit, Wiring,
};

/// What may be wrong at one stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    Angles(Angles),
    Frames(Frames),
    Locals(Reading, Inverse),
    ChainReversed,
    Bind(Bind),
    Translation(Translation),
    JointMatrices(JointMatrices),
    /// As [`JointMatrices::Transposed3`], under the name of what causes it.
    RowMajor(JointMatrices),
    JointQuaternions(Reading),
    Influences(Influences),
    KeepsSum,
    Canonical(Reading, Inverse),
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
    Basis(Basis, Space),
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
pub(crate) const UNITS: [(f64, &str); 5] = [
    (100.0, "centimetres"),
    (1000.0, "millimetres"),
    (0.01, "hundreds of metres"),
    (0.001, "kilometres"),
    (39.370_078_740_157_48, "inches"),
];

impl Change {
    /// Every single change; `vectors` is what an engine may compute in besides the axes of the other files.
    pub(crate) fn all(vectors: &Convention) -> Vec<Self> {
        let files = Convention::default();
        let same = vectors.map == files.map && vectors.units == files.units;
        let spaces: &[Space] = if same { &[Space::Files] } else { &[Space::Vectors, Space::Files] };
        let mut all = joints(spaces);
        all.extend(rotations(spaces));
        all.extend(shapes(spaces));
        all.extend(colours(spaces));
        all.extend(outputs());
        all
    }

    /// Makes the change.
    pub(crate) fn apply(&self, wiring: &mut Wiring) {
        match *self {
            Self::Angles(angles) => wiring.angles = angles,
            Self::Frames(frames) => wiring.frames = frames,
            Self::Locals(reading, _) => wiring.locals = reading,
            Self::ChainReversed => wiring.chain_is_reversed = true,
            Self::Bind(bind) => wiring.bind = bind,
            Self::Translation(translation) => wiring.translation = translation,
            Self::JointMatrices(matrices) | Self::RowMajor(matrices) => wiring.joint_matrices = matrices,
            Self::JointQuaternions(reading) => wiring.joint_quaternions = reading,
            Self::Influences(influences) => wiring.influences = influences,
            Self::KeepsSum => wiring.keeps_sum = true,
            Self::Canonical(reading, _) => wiring.canonical = reading,
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
            Self::Basis(basis, space) => (wiring.basis, wiring.basis_space) = (basis, space),
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
        if let (
            Self::Turned { bands, direction, turn },
            Self::Turned { bands: others, direction: other_direction, turn: other_turn },
        ) = (self, other)
        {
            let shared = bands.iter().zip(others).any(|(a, b)| *a && *b) || (*direction && *other_direction);
            return shared || turn == other_turn;
        }
        let stage = |change: &Self| match change {
            Self::RowMajor(matrices) => std::mem::discriminant(&Self::JointMatrices(*matrices)),
            other => std::mem::discriminant(other),
        };
        stage(self) == stage(other)
    }
}

/// Quaternions of an input, read otherwise.
fn readings(spaces: &[Space]) -> impl Iterator<Item = Reading> {
    let orders = [Order::WLast, Order::WFirst];
    orders.into_iter().flat_map(|order| spaces.iter().map(move |&space| Reading::Misordered(order, space)))
}

/// Poses and joints.
fn joints(spaces: &[Space]) -> Vec<Change> {
    let mut all = vec![
        Change::Angles(Angles::TakenForDegrees),
        Change::Angles(Angles::HandedInDegrees),
        Change::Locals(Reading::Conjugated, Inverse::Conjugated),
        Change::Locals(Reading::Conjugated, Inverse::Transposed),
        Change::ChainReversed,
        Change::Bind(Bind::Missing),
        Change::Bind(Bind::OtherSide),
        Change::Translation(Translation::Missing),
        Change::Translation(Translation::Before),
    ];
    let frames = [Frames::LateFromRest, Frames::LateHeld, Frames::LateAround];
    all.extend(frames.into_iter().chain([Frames::EarlyHeld, Frames::EarlyAround]).map(Change::Frames));
    all.extend(readings(spaces).map(|reading| Change::Locals(reading, Inverse::Conjugated)));
    all.extend(readings(spaces).map(Change::JointQuaternions));
    let lost = [JointMatrices::Transposed4, JointMatrices::Transposed4MeansOnly];
    let kept = [JointMatrices::Transposed3, JointMatrices::Transposed3MeansOnly];
    all.extend(kept.map(Change::JointMatrices));
    all.extend(kept.into_iter().chain(lost).map(Change::RowMajor));
    all
}

/// Weights, the blend and the product with the canonical rotation.
fn rotations(spaces: &[Space]) -> Vec<Change> {
    let mut all = vec![
        Change::KeepsSum,
        Change::Unit(Unit::Raw),
        Change::Unit(Unit::RawMatrix),
        Change::Unit(Unit::RawProduct),
        Change::Product(Product::Swapped),
        Change::Product(Product::NotTurned),
        Change::Product(Product::CanonicalForgotten),
    ];
    all.extend((1..=5).map(|n| Change::Influences(Influences::CutTo(n))));
    all.extend([15, 255].map(|levels| Change::Influences(Influences::Levels(levels))));
    all.extend(readings(spaces).map(|reading| Change::Canonical(reading, Inverse::Conjugated)));
    for name in [Inverse::Conjugated, Inverse::Transposed] {
        all.extend([
            Change::Relative(name),
            Change::Posed(name),
            Change::Canonical(Reading::Conjugated, name),
        ]);
    }
    all.extend(blends(spaces).into_iter().map(Change::Blend));
    all
}

/// Scales and covariances.
fn shapes(spaces: &[Space]) -> Vec<Change> {
    let mut all = vec![
        Change::Covariance(Covariance::Blended),
        Change::Scale(Scale::GeometricBall),
        Change::Scale(Scale::ArithmeticBall),
    ];
    for &space in spaces {
        all.extend([Scale::Ones(space), Scale::Twice(space), Scale::Never(space)].map(Change::Scale));
        all.push(Change::Covariance(Covariance::NotSquared(space)));
    }
    all
}

/// SH and view directions.
fn colours(spaces: &[Space]) -> Vec<Change> {
    let mut all = turns();
    all.push(Change::DirectionReversed);
    // A mirror of z is the turn of odd orders and a point reflection, which no turn shows.
    let bases = [Basis::OddOrders, Basis::Axis(0), Basis::Axis(1)];
    for &space in spaces {
        let all_bases = bases.into_iter().chain((1..16).map(Basis::One));
        all.extend(all_bases.map(|basis| Change::Basis(basis, space)));
    }
    all
}

/// Axes, units, activation and orders of what is handed over.
fn outputs() -> Vec<Change> {
    let mut all = vec![
        Change::Order(Order::WLast),
        Change::Order(Order::WFirst),
        Change::Opacity(Activation::Twice),
        Change::Opacity(Activation::Never),
    ];
    let layouts = [ShLayout::Planar, ShLayout::Interleaved, ShLayout::OrdersReversed, ShLayout::Bgr];
    all.extend(layouts.map(Change::Layout));
    all.extend((0..3).map(Change::Mirror));
    for turned in [Turned::YToZ, Turned::ZToY, Turned::Half] {
        all.extend([Axes::World(turned), Axes::Both(turned)].map(Change::Axes));
    }
    all.extend(UNITS.map(|(factor, _)| Change::Units(factor)));
    all
}

/// Any of the bands and the direction, not turned or turned backwards.
fn turns() -> Vec<Change> {
    let mut all = Vec::new();
    for turn in [Turn::Not, Turn::Backwards] {
        for mask in 0..8u8 {
            let bands = [0, 1, 2].map(|l| mask & (1 << l) != 0);
            for direction in [false, true].into_iter().filter(|&direction| mask > 0 || direction) {
                all.push(Change::Turned { bands, direction, turn });
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
        let convention = Convention::default();
        let pipeline = Pipeline { rig: &rig, convention, vectors: convention, storage: Storage::Activated };
        let outputs = |change: Option<&Change>| -> Vec<Sample> {
            let mut wiring = Wiring::default();
            change.iter().for_each(|change| change.apply(&mut wiring));
            (0..rig.poses.len()).flat_map(|frame| pipeline.frame(&wiring, frame)).collect()
        };
        let right = outputs(None);
        let seen: Vec<(Change, Vec<Sample>)> = Change::all(&Convention::default())
            .into_iter()
            .map(|change| (change, outputs(Some(&change))))
            .collect();
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
