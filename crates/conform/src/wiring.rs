//! The stages of the computation, and what can go wrong at each. The default of every stage is the right one.

use skinsplat_core::math::Matrix3;

/// How every stage is computed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Wiring {
    pub(crate) angles: Angles,
    pub(crate) frames: Frames,
    /// Of the joints, relative to their parents.
    pub(crate) locals: Reading,
    pub(crate) chain_is_reversed: bool,
    pub(crate) bind: Bind,
    pub(crate) translation: Translation,
    pub(crate) joint_matrices: JointMatrices,
    pub(crate) joint_quaternions: Reading,
    pub(crate) influences: Influences,
    pub(crate) keeps_sum: bool,
    pub(crate) canonical: Reading,
    pub(crate) blend: Blend,
    pub(crate) unit: Unit,
    pub(crate) relative_is_inverted: bool,
    pub(crate) product: Product,
    pub(crate) posed_is_inverted: bool,
    pub(crate) scale: Scale,
    pub(crate) covariance: Covariance,
    /// Bands 1 to 3.
    pub(crate) sh: [Turn; 3],
    pub(crate) direction: Turn,
    /// From the Gaussian to the camera.
    pub(crate) direction_is_reversed: bool,
    pub(crate) basis: Basis,
    /// Where SH are turned, which is to be seen only in another basis.
    pub(crate) basis_space: Space,
    pub(crate) mirror: Option<usize>,
    pub(crate) axes: Axes,
    pub(crate) order: Order,
    pub(crate) units: Option<f64>,
    pub(crate) opacity: Activation,
    pub(crate) layout: ShLayout,
}

/// In whose axes and units a stage is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Space {
    /// Those of the vectors.
    #[default]
    Vectors,
    /// Those of PLY, body and poses, whatever the vectors are in.
    Files,
}

/// How pose angles are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Angles {
    #[default]
    Radians,
    /// Radians taken for degrees: nearly nothing turns.
    TakenForDegrees,
    /// Degrees handed to something that wants radians.
    HandedInDegrees,
}

/// Which pose is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Frames {
    #[default]
    Own,
    /// The one before; at first the rest pose.
    LateFromRest,
    /// The one before; at first the first.
    LateHeld,
    /// The one before; at first the last.
    LateAround,
    /// The next; at last the last.
    EarlyHeld,
    /// The next; at last the first.
    EarlyAround,
}

/// What becomes of the inverse bind matrices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Bind {
    /// World matrix times inverse bind matrix.
    #[default]
    Right,
    Missing,
    /// Inverse bind matrix times world matrix.
    OtherSide,
}

/// What becomes of the translation of a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Translation {
    /// Added after skinning.
    #[default]
    Right,
    Missing,
    /// Added before: the joints turn it.
    Before,
}

/// What is done to the joints' matrices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum JointMatrices {
    #[default]
    Right,
    /// The 3x3 part transposed, and the rotations that are read from it.
    Transposed3,
    /// The same for the means only.
    Transposed3MeansOnly,
    /// The 4x4 matrix transposed: the translation is lost.
    Transposed4,
    /// The same for the means only.
    Transposed4MeansOnly,
}

/// In which order quaternions are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Order {
    #[default]
    Right,
    /// (x, y, z, w) where (w, x, y, z) belongs.
    WLast,
    /// (w, x, y, z) where (x, y, z, w) belongs.
    WFirst,
}

impl Order {
    /// A quaternion (w, x, y, z) as whoever reads it in this order takes it.
    pub(crate) fn misread(self, q: [f64; 4]) -> [f64; 4] {
        let [a, b, c, d] = q;
        match self {
            Self::Right => q,
            Self::WLast => [b, c, d, a],
            Self::WFirst => [d, a, b, c],
        }
    }
}

/// How quaternions of an input are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Reading {
    #[default]
    Right,
    Conjugated,
    /// With w at the other end, in the axes of a file.
    Misordered(Order, Space),
}

/// Which weights count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Influences {
    #[default]
    All,
    /// The heaviest.
    CutTo(usize),
    /// Rounded to so many levels.
    Levels(u32),
}

/// Signs of quaternions before they are summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signs {
    /// Aligned to the heaviest bone, which the rig stores first.
    Heaviest,
    /// Each aligned to the sum so far.
    Running,
    /// As the vectors hand them out.
    Given,
    /// w at least 0.
    NonNegativeW,
    /// The component of largest magnitude positive.
    LargestPositive(Space),
    /// As the usual routine reads them from matrices: w positive where the trace is, else the largest other component.
    FromMatrices(Space),
    /// As products of the local rotations along the chain.
    Chained,
}

/// How a matrix becomes a quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Conversion {
    /// The candidate with the largest component (PyTorch3D, Eigen's branches).
    Largest,
    /// Through w where the trace is positive (Shepperd's branches, as in most engines).
    TraceFirst,
    /// Four square roots, signs from the off-diagonal differences.
    FourRoots,
}

/// How a matrix is made orthonormal: which axes, one after the other; the third follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GramSchmidt {
    pub(crate) rows: bool,
    pub(crate) first: usize,
    pub(crate) second: usize,
    pub(crate) of: Of,
}

/// What the quaternion is read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Of {
    /// The blended matrix B.
    Blend,
    /// B R_c, which gives the posed rotation at once.
    Product,
}

/// Where power iteration starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum From {
    Heaviest,
    Ones,
    Identity,
}

/// How the joints' rotations become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Blend {
    #[default]
    Average,
    Power(u32, From),
    Sum(Signs),
    GramSchmidt(GramSchmidt),
    Converted(Conversion, Of),
    Dual(Signs),
}

/// Whether a blended quaternion is normalised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Unit {
    #[default]
    Normalised,
    /// The sum as it is; the covariance from the normalised one.
    Raw,
    /// The sum as it is, in the matrix (1 - 2 (y² + z²), …) of covariances and directions too.
    RawMatrix,
    /// The sum as it is, in covariances and directions as q v q*, which scales by |q|².
    RawProduct,
}

/// How canonical and relative rotation are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Product {
    #[default]
    Right,
    /// R_c A in place of A R_c.
    Swapped,
    /// R_c alone: Gaussians move and do not turn.
    NotTurned,
    /// A alone: the canonical rotation is forgotten.
    CanonicalForgotten,
}

/// Standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Scale {
    #[default]
    Right,
    /// One unit along each axis.
    Ones(Space),
    /// Balls of the geometric mean.
    GeometricBall,
    /// Balls of the arithmetic mean.
    ArithmeticBall,
    /// Activated twice: exp of what is a standard deviation already.
    Twice(Space),
    /// Not activated: the logarithm where a standard deviation belongs.
    Never(Space),
}

/// How the covariance is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Covariance {
    #[default]
    Rotated,
    /// B Σ_c Bᵀ with the blended matrix as it is.
    Blended,
    /// R S Rᵀ: standard deviations in place of variances.
    NotSquared(Space),
}

/// Whether SH or view directions are turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Turn {
    #[default]
    Right,
    Not,
    Backwards,
}

/// Signs of basis functions in which SH are turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Basis {
    #[default]
    Right,
    /// Without the factor (-1)^m.
    OddOrders,
    /// With one axis mirrored.
    Axis(usize),
    /// One coefficient.
    One(usize),
}

/// World axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Axes {
    #[default]
    Right,
    /// The world turned; canonical frames stay.
    World(Turned),
    /// World and canonical frame turned.
    Both(Turned),
}

/// A turn about x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turned {
    /// y becomes z: (x, -z, y).
    YToZ,
    /// z becomes y: (x, z, -y).
    ZToY,
    /// y down: (x, -y, -z).
    Half,
}

impl Turned {
    pub(crate) fn matrix(self) -> Matrix3<f64> {
        match self {
            Self::YToZ => [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
            Self::ZToY => [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
            Self::Half => [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        }
    }

    pub(crate) fn quaternion(self) -> [f64; 4] {
        let h = std::f64::consts::FRAC_1_SQRT_2;
        match self {
            Self::YToZ => [h, h, 0.0, 0.0],
            Self::ZToY => [h, -h, 0.0, 0.0],
            Self::Half => [0.0, 1.0, 0.0, 0.0],
        }
    }
}

/// Whether opacities went through the sigmoid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Activation {
    #[default]
    Right,
    Twice,
    Never,
}

/// The order of SH numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ShLayout {
    #[default]
    Right,
    /// Channel by channel where coefficient by coefficient belongs, bands 1 to 3.
    Planar,
    /// The reverse.
    Interleaved,
    /// m from l down to -l.
    OrdersReversed,
    /// B G R, in all bands.
    Bgr,
}
