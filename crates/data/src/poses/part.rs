//! The parts of an SMPL-like pose, and the joints that they are in the bodies of the family.

use std::fmt;
use std::ops::Range;

/// A part of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All joints in the order of the body.
    Whole,
    /// The root.
    GlobalOrient,
    /// 21 joints, or the 23 of SMPL, whose last two are the hands.
    BodyPose,
    /// The jaw.
    Jaw,
    /// The left eye.
    LeftEye,
    /// The right eye.
    RightEye,
    /// 15 finger joints of the left hand.
    LeftHand,
    /// 15 finger joints of the right hand.
    RightHand,
}

impl Part {
    /// What the smplx package calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Whole => "thetas",
            Self::GlobalOrient => "global_orient",
            Self::BodyPose => "body_pose",
            Self::Jaw => "jaw_pose",
            Self::LeftEye => "leye_pose",
            Self::RightEye => "reye_pose",
            Self::LeftHand => "left_hand_pose",
            Self::RightHand => "right_hand_pose",
        }
    }

    /// The numbers of joints that it may have; none for any.
    pub(super) fn joints(self) -> &'static [usize] {
        match self {
            Self::Whole => &[],
            Self::GlobalOrient | Self::Jaw | Self::LeftEye | Self::RightEye => &[1],
            Self::BodyPose => &[],
            Self::LeftHand | Self::RightHand => &[15],
        }
    }

    pub(super) fn is_hand(self) -> bool {
        matches!(self, Self::LeftHand | Self::RightHand)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Which bodies have their joints in an order that is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    /// 24 joints: the last two are the hands, without fingers.
    Smpl,
    /// 52 joints: 22 of the body, 15 of each hand.
    SmplH,
    /// 55 joints: the jaw and the eyes lie between body and hands.
    SmplX,
}

impl Family {
    pub(super) fn of(joints: usize) -> Option<Self> {
        match joints {
            24 => Some(Self::Smpl),
            52 => Some(Self::SmplH),
            55 => Some(Self::SmplX),
            _ => None,
        }
    }

    /// The joints of a part in a body of this family; empty if it has none.
    pub(super) fn place(self, part: Part) -> Range<usize> {
        match (self, part) {
            (_, Part::GlobalOrient) => 0..1,
            (Self::Smpl, Part::BodyPose) => 1..24,
            (_, Part::BodyPose) => 1..22,
            (Self::SmplX, Part::Jaw) => 22..23,
            (Self::SmplX, Part::LeftEye) => 23..24,
            (Self::SmplX, Part::RightEye) => 24..25,
            (Self::SmplH, Part::LeftHand) => 22..37,
            (Self::SmplH, Part::RightHand) => 37..52,
            (Self::SmplX, Part::LeftHand) => 25..40,
            (Self::SmplX, Part::RightHand) => 40..55,
            (_, Part::Whole) => 0..0,
            (Self::Smpl, _) | (Self::SmplH, Part::Jaw | Part::LeftEye | Part::RightEye) => 0..0,
        }
    }
}
