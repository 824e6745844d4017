//! What the changes of the catalogue are called in reports: a kind, details, a sentence.

use super::blends::{details_of_blend, kind_of_blend, summary_of_blend};
use super::change::{Change, Inverse, UNITS};
use super::convention::Convention;
use super::pipeline::{Pipeline, is_flipped};
use super::wiring::{
    Activation, Angles, Axes, Bind, Blend, Covariance, Frames, Influences, JointMatrices, Product, Reading,
    Scale, ShLayout, Signs, Space, Translation, Turn, Turned,
};
use serde_json::{Value, json};

impl Inverse {
    fn kind(self) -> &'static str {
        match self {
            Self::Conjugated => "conjugated",
            Self::Transposed => "transposed",
        }
    }
}

impl Change {
    /// Its name in reports.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Angles(_) => "degrees-for-radians",
            Self::Frames(Frames::EarlyHeld | Frames::EarlyAround) => "one-frame-early",
            Self::Frames(_) => "one-frame-late",
            Self::Locals(Reading::Conjugated, name) | Self::Canonical(Reading::Conjugated, name) => {
                name.kind()
            }
            Self::ChainReversed => "chain-reversed",
            Self::Bind(Bind::OtherSide) => "bind-pose-on-other-side",
            Self::Bind(_) => "bind-pose-missing",
            Self::Translation(Translation::Before) => "translation-before-skinning",
            Self::Translation(_) => "translation-missing",
            Self::JointMatrices(_) => "transposed",
            Self::RowMajor(_) => "row-major-matrices",
            Self::Locals(..) | Self::JointQuaternions(_) | Self::Canonical(..) | Self::Order(_) => {
                "xyzw-for-wxyz"
            }
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
            Self::Relative(name) | Self::Posed(name) => name.kind(),
            Self::Product(Product::Swapped) => "product-swapped",
            Self::Product(Product::CanonicalForgotten) => "canonical-rotation-missing",
            Self::Product(_) => "gaussians-not-turned",
            Self::Scale(Scale::Twice(_)) => "activated-scale",
            Self::Scale(Scale::Never(_)) => "scale-not-activated",
            Self::Scale(_) => "scale-ignored",
            Self::Covariance(Covariance::NotSquared(_)) => "scale-not-squared",
            Self::Covariance(_) => "blended-matrix-not-projected",
            Self::Turned { turn: Turn::Backwards, .. } => "sh-turned-backwards",
            Self::Turned { .. } => "sh-not-turned",
            Self::DirectionReversed => "direction-reversed",
            Self::Basis(..) => "sh-basis-sign",
            Self::Mirror(_) => "mirrored-handedness",
            Self::Axes(Axes::World(Turned::Half) | Axes::Both(Turned::Half)) => "y-down-for-y-up",
            Self::Axes(_) => "y-up-for-z-up",
            Self::Units(_) => "other-units",
            Self::Opacity(Activation::Never) => "opacity-not-activated",
            Self::Opacity(_) => "activated-opacity",
            Self::Layout(ShLayout::Bgr) => "bgr-for-rgb",
            Self::Layout(_) => "sh-order",
        }
    }

    /// What a program may want to know besides the kind; axes are named as `pipeline` has them.
    pub(crate) fn details(&self, pipeline: &Pipeline<'_>) -> Value {
        let mut details = self.own_details(&pipeline.convention);
        let elsewhere = pipeline.vectors.map != Convention::default().map
            || pipeline.vectors.units != Convention::default().units;
        if let (Some(space), Some(object)) = (self.space().filter(|_| elsewhere), details.as_object_mut()) {
            object.insert("in_axes_of".to_owned(), json!(pipeline.space(space).name));
        }
        details
    }

    /// Where the stage is computed, if that matters.
    fn space(&self) -> Option<Space> {
        match *self {
            Self::Locals(Reading::Misordered(_, space), _)
            | Self::JointQuaternions(Reading::Misordered(_, space))
            | Self::Canonical(Reading::Misordered(_, space), _)
            | Self::Scale(Scale::Ones(space) | Scale::Twice(space) | Scale::Never(space))
            | Self::Covariance(Covariance::NotSquared(space))
            | Self::Basis(_, space)
            | Self::Blend(
                Blend::Sum(Signs::LargestPositive(space) | Signs::FromMatrices(space))
                | Blend::Dual(Signs::LargestPositive(space) | Signs::FromMatrices(space)),
            ) => Some(space),
            _ => None,
        }
    }

    fn own_details(&self, convention: &Convention) -> Value {
        match self {
            Self::Angles(angles) => json!({ "factor": match angles {
                Angles::HandedInDegrees => "180/pi",
                _ => "pi/180",
            } }),
            Self::Frames(frames) => match frames {
                Frames::Own => json!({}),
                Frames::LateFromRest => json!({ "first_pose": "rest" }),
                Frames::LateHeld => json!({ "first_pose": "itself" }),
                Frames::LateAround => json!({ "first_pose": "last" }),
                Frames::EarlyHeld => json!({ "last_pose": "itself" }),
                Frames::EarlyAround => json!({ "last_pose": "first" }),
            },
            Self::Locals(..) => json!({ "of": "local rotations of the joints" }),
            Self::RowMajor(JointMatrices::Transposed4 | JointMatrices::Transposed4MeansOnly) => {
                json!({ "translation": "lost" })
            }
            Self::JointMatrices(_) | Self::RowMajor(_) => json!({ "of": "joint matrices" }),
            Self::JointQuaternions(_) => json!({ "of": "joint quaternions" }),
            Self::Canonical(..) => json!({ "of": "canonical rotations" }),
            Self::Order(_) => json!({ "of": "answer" }),
            Self::Influences(Influences::CutTo(count)) => json!({ "influences": count }),
            Self::Influences(Influences::Levels(levels)) => json!({ "levels": levels }),
            Self::Blend(blend) => details_of_blend(blend, convention),
            Self::Relative(_) => json!({ "of": "relative rotation" }),
            Self::Posed(_) => json!({ "of": "posed rotation" }),
            Self::Turned { bands, direction, .. } => {
                let named: Vec<usize> = (1..4).filter(|l| bands[l - 1]).collect();
                json!({ "bands": named, "view_direction": direction })
            }
            Self::Basis(basis, _) => {
                let flipped: Vec<usize> = (1..16).filter(|&k| is_flipped(*basis, k)).collect();
                json!({ "coefficients": flipped, "where": "while turning" })
            }
            Self::Mirror(axis) => json!({ "axis": convention.axis_name(*axis) }),
            Self::Axes(Axes::World(turned) | Axes::Both(turned)) => {
                let shown = convention.shown(&turned.matrix());
                let named = match turned {
                    _ if convention.map[1] != [0.0, 1.0, 0.0] => shown,
                    Turned::Half => format!("y down: {shown}"),
                    Turned::YToZ => format!("z up: {shown}"),
                    Turned::ZToY => format!("y from z: {shown}"),
                };
                json!({ "answer_is": named })
            }
            Self::Units(factor) => {
                let name = UNITS.iter().find(|(known, _)| known == factor).map_or("", |(_, name)| name);
                json!({ "per_metre": factor, "unit": name })
            }
            Self::Scale(scale) => json!({ "drawn_as": match scale {
                Scale::Ones(_) => "1 along each axis",
                Scale::GeometricBall => "balls of the geometric mean",
                Scale::ArithmeticBall => "balls of the arithmetic mean",
                Scale::Twice(_) => "exp of the standard deviation",
                _ => "logarithms",
            } }),
            Self::Layout(layout) => json!({ "order": match layout {
                ShLayout::Planar => "channel by channel",
                ShLayout::Interleaved => "coefficient by coefficient",
                ShLayout::Bgr => "B G R",
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
            Self::Frames(Frames::EarlyHeld | Frames::EarlyAround) => {
                "the answer to a pose is that of the next pose"
            }
            Self::Frames(_) => "the answer to a pose is that of the pose before",
            Self::Locals(Reading::Conjugated, Inverse::Conjugated) => {
                "the joints' local rotations are conjugated (or their angles negated): they bend backwards"
            }
            Self::Locals(Reading::Conjugated, Inverse::Transposed) => {
                "the joints' local rotation matrices are transposed: they bend backwards"
            }
            Self::Locals(..) => "the joints' local quaternions were read with w at the other end",
            Self::ChainReversed => {
                "matrices along the chain of joints are multiplied in the wrong order: local times parent"
            }
            Self::Bind(Bind::OtherSide) => {
                "the inverse bind matrix is multiplied on the wrong side: inverse bind times world matrix"
            }
            Self::Translation(Translation::Before) => {
                "the translation of the pose was added before skinning, so that the joints turn it"
            }
            Self::Translation(_) => "the translation of the pose (`transl`) is left out",
            Self::Bind(_) => {
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
            Self::Canonical(Reading::Conjugated, Inverse::Conjugated) => {
                "the canonical quaternions are conjugated"
            }
            Self::Canonical(Reading::Conjugated, Inverse::Transposed) => {
                "the canonical rotation matrices are transposed"
            }
            Self::Canonical(..) => "the canonical quaternions were read with w at the other end",
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
            Self::Scale(Scale::Twice(_)) => {
                "activated standard deviations stand where logarithms belong (or exp was applied twice)"
            }
            Self::Scale(Scale::Never(_)) => {
                "logarithms stand where standard deviations belong (exp was not applied)"
            }
            Self::Scale(_) => "the Gaussians' scales are ignored",
            Self::Covariance(Covariance::NotSquared(_)) => {
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
            Self::Basis(..) => "SH were turned in a basis with other signs",
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
            Self::Layout(ShLayout::Bgr) => "the channels of the SH are B, G, R",
            Self::Layout(_) => "SH coefficients are in another order",
        };
        text.to_owned()
    }
}
