//! What the arrays of a pose file are called by those who write them.

use super::part::Part;

/// A pose of all joints in one array: ours, AMASS and EasyMocap, AIST++, GRAB, videoavatars.
pub(super) const WHOLE: &[&str] = &["thetas", "poses", "smpl_poses", "fullpose", "full_pose", "pose"];

/// A part, and the names of its array: the smplx package, AMASS of SMPL-X, others.
pub(super) const PARTS: [(Part, &[&str]); 7] = [
    (Part::GlobalOrient, &["global_orient", "root_orient", "root_pose"]),
    (Part::BodyPose, &["body_pose", "pose_body"]),
    (Part::Jaw, &["jaw_pose", "pose_jaw"]),
    (Part::LeftEye, &["leye_pose"]),
    (Part::RightEye, &["reye_pose"]),
    (Part::LeftHand, &["left_hand_pose", "lhand_pose"]),
    (Part::RightHand, &["right_hand_pose", "rhand_pose"]),
];

/// Two parts in one array, the left one first.
pub(super) const PAIRS: [(Part, Part, &[&str]); 2] = [
    (Part::LeftEye, Part::RightEye, &["pose_eye", "eye_pose", "eyes_pose"]),
    (Part::LeftHand, Part::RightHand, &["pose_hand", "hand_pose", "hands_pose"]),
];

/// The translation, added after scaling.
pub(super) const TRANSLATION: &[&str] = &["transl", "trans", "smpl_trans", "Th", "translation", "root_trans"];

/// The scale of the body, per frame or of all.
pub(super) const SCALE: &[&str] = &["scale", "smpl_scaling", "scaling", "smpl_scale", "body_scale"];

/// Shape coefficients.
pub(super) const BETAS: &[&str] = &["betas", "shapes", "beta", "shape"];

/// Frames per second.
pub(super) const FRAMERATE: &[&str] = &["mocap_framerate", "mocap_frame_rate", "framerate", "fps"];

/// What says nothing about how a body is posed.
const DESCRIPTIONS: &[&str] = &[
    "gender",
    "surface_model_type",
    "num_betas",
    "source_frame",
    "smpl_loss",
    "mocap_time_length",
    "joint_names",
    "flat_hand_mean",
    "use_pca",
    "num_pca_comps",
    "id",
    "model",
    "model_type",
];

/// Names of one thing each, of which the first that a file has is read.
pub(super) fn synonyms() -> impl Iterator<Item = &'static [&'static str]> {
    let parts = PARTS.iter().map(|(_, names)| *names).chain(PAIRS.iter().map(|(.., names)| *names));
    [WHOLE, TRANSLATION, SCALE, BETAS, FRAMERATE].into_iter().chain(parts)
}

/// True for arrays that are read, repeat what is read, or only describe it.
pub(super) fn is_known(name: &str) -> bool {
    [WHOLE, TRANSLATION, SCALE, BETAS, FRAMERATE, DESCRIPTIONS, &["expression"]].iter().any(|list| list.contains(&name))
        || PARTS.iter().any(|(_, names)| names.contains(&name))
        || PAIRS.iter().any(|(.., names)| names.contains(&name))
        // AMASS keeps its markers and names beside the motion.
        || name.starts_with("marker") || name.starts_with("labels")
}
