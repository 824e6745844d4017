//! What is chosen at compile time: an entry point per choice.

/// How the joints' rotations become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rotation {
    /// The exact average of the first two influences; the others are not read.
    TwoBones,
    /// The exact average (Eq. 7): nothing for one joint, a formula for two, repeated squaring for more.
    ClosedForm,
    /// Power steps from the heaviest joint, as many as the parameters say.
    Power,
    /// The normalised sum of quaternions on the side of the heaviest joint.
    AlignedSum,
    /// Dual quaternions on the side of the heaviest joint; the mean follows them too.
    DualQuaternion,
}

impl Rotation {
    /// Every choice.
    pub const ALL: [Self; 5] =
        [Self::TwoBones, Self::ClosedForm, Self::Power, Self::AlignedSum, Self::DualQuaternion];

    /// The first half of the entry point's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::TwoBones => "two_bones",
            Self::ClosedForm => "closed_form",
            Self::Power => "power",
            Self::AlignedSum => "aligned_sum",
            Self::DualQuaternion => "dual_quaternion",
        }
    }

    /// The entry point.
    pub fn entry_point(self, shape: Shape) -> String {
        format!("{}_{}", self.name(), shape.name())
    }
}

/// What is written of a Gaussian's shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// xx, xy, xz, yy, yz, zz of the covariance.
    Covariance,
    /// The posed quaternion; standard deviations stay.
    Quaternion,
}

impl Shape {
    /// Every choice.
    pub const ALL: [Self; 2] = [Self::Covariance, Self::Quaternion];

    /// The second half of the entry point's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Covariance => "covariance",
            Self::Quaternion => "quaternion",
        }
    }
}

/// What is done about view-dependent colour, in a dispatch of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// RGB of the rest pose's SH, read along the turned view direction.
    AlongView,
    /// SH turned, for an engine that evaluates them.
    TurnSh,
}

impl Colour {
    /// Every choice.
    pub const ALL: [Self; 2] = [Self::AlongView, Self::TurnSh];

    /// The entry point.
    pub fn entry_point(self) -> &'static str {
        match self {
            Self::AlongView => "colour",
            Self::TurnSh => "turn_sh",
        }
    }
}

/// The name of every entry point.
pub fn entry_points() -> Vec<String> {
    let posing = Rotation::ALL.iter().flat_map(|r| Shape::ALL.map(|shape| r.entry_point(shape)));
    posing.chain(Colour::ALL.map(|c| c.entry_point().to_owned())).collect()
}
