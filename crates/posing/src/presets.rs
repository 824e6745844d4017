//! The paper's four strategies, the stock methods that it compares with ("Original" in Tables 1-5), and more.

use super::{
    Across, ClampChoice, ColourChoice, CovarianceChoice, FaceFrame, LbsProjection, RotationChoice, Strategy,
};
use skinsplat_core::math::average::{Solver, Start};
use skinsplat_core::math::rotation::SignPolicy;

/// A strategy with a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// Stable id, used in experiments and on the command line.
    pub id: &'static str,
    /// For headings.
    pub title: &'static str,
    /// What it does, in a sentence.
    pub summary: &'static str,
    /// The choices.
    pub strategy: Strategy,
}

/// Every preset. The first four are the paper's, in its order; the last, `engine-…`, are what engines do that skin splats, as far
/// as a strategy can say it.
pub const PRESETS: &[Preset] = &[
    Preset {
        id: "lbs",
        title: "LBS",
        summary: "the blended matrix, orthonormalised by Gram-Schmidt over its columns; SH alone",
        strategy: Strategy {
            rotation: RotationChoice::Lbs(LbsProjection::GramSchmidtColumns),
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "face-tbn",
        title: "Face TBN",
        summary: "the tangent frame of the face under the Gaussian; SH alone",
        strategy: Strategy {
            rotation: RotationChoice::FaceFrame(FaceFrame::SplattingAvatar),
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "view-canonical",
        title: "View-canonical",
        summary: "the blended matrix on the covariance, its transpose on the view direction",
        strategy: Strategy {
            rotation: RotationChoice::Lbs(LbsProjection::Polar),
            covariance: CovarianceChoice::Affine,
            colour: ColourChoice::ViewBlend,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "quaternion-average",
        title: "Quaternion average",
        summary: "the paper's: weighted average of the joints' quaternions (Eq. 7), SH rotated with it (Eq. 9)",
        strategy: Strategy {
            rotation: RotationChoice::QuaternionAverage(Solver::ClosedForm),
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::RotateSh,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "dual-quaternion",
        title: "Dual quaternion",
        summary: "dual-quaternion blending of position and rotation, SH rotated with it",
        strategy: Strategy {
            rotation: RotationChoice::DualQuaternion,
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::RotateSh,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "hugs-original",
        title: "HUGS (original)",
        summary: "PyTorch3D's quaternion of B R_c, drawn without normalising it; SH alone",
        strategy: Strategy {
            rotation: RotationChoice::Lbs(LbsProjection::MatrixToQuaternionRaw),
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "ihuman-original",
        title: "iHuman (original)",
        summary: "a 1 mm disc in the frame [n | r1' | r2'] of its face, the in-plane angle fixed; SH alone",
        strategy: Strategy {
            rotation: RotationChoice::FaceFrame(FaceFrame::IHuman),
            covariance: CovarianceChoice::Surfel,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "splattingavatar-original",
        title: "SplattingAvatar (original)",
        summary: "face rotations summed at vertices and barycentrically (w >= 0); direction turned back by the sum",
        strategy: Strategy {
            rotation: RotationChoice::VertexQuaternions(SignPolicy::NonNegativeW),
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::ViewRotation,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "animatable-original",
        title: "Animatable 3D Gaussians (original)",
        summary: "B R_c^T S^2 R_c B^T, the view direction multiplied by B^T, colours clamped to [0, 1]",
        strategy: Strategy {
            rotation: RotationChoice::Lbs(LbsProjection::Polar),
            covariance: CovarianceChoice::AffineConjugate,
            colour: ColourChoice::ViewBlend,
            clamp: ClampChoice::Unit,
        },
    },
    Preset {
        id: "push-forward",
        title: "Push-forward",
        summary: "covariance deformed by the derivative of LBS with its weights' gradients, SH rotated by its nearest rotation",
        strategy: Strategy {
            rotation: RotationChoice::PushForward(Across::Constant),
            covariance: CovarianceChoice::PushForward,
            colour: ColourChoice::RotateSh,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "push-forward-normal",
        title: "Push-forward, thickness kept",
        summary: "the same, the normal carried to the posed normal with its length kept",
        strategy: Strategy {
            rotation: RotationChoice::PushForward(Across::Normal),
            covariance: CovarianceChoice::PushForwardNormal,
            colour: ColourChoice::RotateSh,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "push-forward-average-sh",
        title: "Push-forward, SH by the average",
        summary: "covariance as push-forward-normal, SH rotated by the quaternion average: what the covariance alone is worth",
        strategy: Strategy {
            rotation: RotationChoice::QuaternionAverage(Solver::ClosedForm),
            covariance: CovarianceChoice::PushForwardNormal,
            colour: ColourChoice::RotateSh,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "average-push-forward-sh",
        title: "Average, SH by the push-forward",
        summary: "covariance rotated by the quaternion average, SH as push-forward-normal: what the turn of SH alone is worth",
        strategy: Strategy {
            rotation: RotationChoice::PushForward(Across::Normal),
            covariance: CovarianceChoice::RotateByAverage,
            colour: ColourChoice::RotateSh,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "engine-spark",
        title: "Spark (engine)",
        summary: "Spark's skinning, without its 8-bit weights and cut to four bones: dual quaternions, SH alone",
        strategy: Strategy {
            rotation: RotationChoice::DualQuaternion,
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "engine-gaussian-vrm",
        title: "gaussian-vrm (engine)",
        summary: "gaussian-vrm's, without the component that it negates by hand: quaternion of the blended matrix, SH alone",
        strategy: Strategy {
            rotation: RotationChoice::Lbs(LbsProjection::MatrixToQuaternion),
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "engine-gaussian-vrm-ue5",
        title: "gaussian-vrm-ue5 (engine)",
        summary: "the Unreal port of gaussian-vrm: sum of the joints' quaternions, signs not aligned; SH alone",
        strategy: Strategy {
            rotation: RotationChoice::JointSum,
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
    Preset {
        id: "engine-babylon",
        title: "Babylon.js (engine)",
        summary: "turned with the heaviest bone alone, as a rigid part (means still blend here); SH alone",
        strategy: Strategy {
            rotation: RotationChoice::QuaternionAverage(Solver::Power { steps: 0, start: Start::Heaviest }),
            covariance: CovarianceChoice::Rotate,
            colour: ColourChoice::None,
            clamp: ClampChoice::NonNegative,
        },
    },
];

impl Preset {
    /// True for what an engine does.
    pub fn is_engine(&self) -> bool {
        self.id.starts_with("engine-")
    }
}

impl Strategy {
    /// The preset of that id.
    pub fn preset(id: &str) -> Option<Self> {
        PRESETS.iter().find(|preset| preset.id == id).map(|preset| preset.strategy)
    }
}
