//! What a synthetic subject is made of, as TOML.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use skinsplat_core::scene::{SceneError, camera::MAX_IMAGE_SIDE};
use skinsplat_data::Capture;

/// Raised whenever the same parameters would give other bodies, motions or images.
pub const GENERATOR_VERSION: u32 = 2;

/// All parameters of a subject. Every field has a default; unknown fields are refused.
///
/// ```
/// use skinsplat_synthetic::Parameters;
/// let text = r#"
/// capture = "monocular"
/// resolution = 256
/// [rig]
/// kind = "arm"
/// bones = 3
/// [motion]
/// twist_degrees = 180.0
/// "#;
/// let parameters: Parameters = toml::from_str(text)?;
/// parameters.validate()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// How many cameras look at what.
    pub capture: Capture,
    /// Seed of every random choice (noise of the textures, phases of the motion).
    pub seed: u32,
    /// Side of the square images, pixels.
    pub resolution: u32,
    /// Samples per pixel and axis of the true images.
    pub samples: u32,
    /// Frames (poses) of the training sequence.
    pub train_frames: u32,
    /// Frames (poses) of each test sequence.
    pub test_frames: u32,
    /// Cameras of the training sequence; 1 unless the capture is multiview.
    pub train_cameras: u32,
    /// Cameras of each test sequence; 1 unless the capture is multiview.
    pub test_cameras: u32,
    /// What the lights are fixed to.
    pub lights: Lights,
    /// The body.
    pub rig: Rig,
    /// How it moves.
    pub motion: Motion,
    /// What it looks like.
    pub look: Look,
}

/// What the lights are fixed to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lights {
    /// The world, as in a studio: a highlight slides over the surface when the subject turns. To one fixed camera the lights
    /// turn together with the line of sight, as seen from the surface: but for a roll about that line, colours read in the
    /// surface's own frame can follow as far as their SH bands reach, and colours read in world directions cannot. To
    /// several cameras one view of the surface appears under different lights, which no function of the view follows.
    #[default]
    World,
    /// The camera, as a rig of lamps around the lens: where a camera at +Z that looks along -Z finds [`Lights::World`]'s, every
    /// camera finds them. To one camera that never moves it is a studio that may have been turned; to several, a view of the
    /// surface always appears under the same lights.
    Camera,
    /// The surface: colours are those of the rest pose seen from the direction that the local rotation (the polar factor
    /// of the blend) takes to the rest pose. Not physical, but the question whether SH must turn with the surface then has
    /// an exact answer.
    Body,
}

/// The body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Rig {
    /// A human figure with SMPL's joints.
    Figure(FigureShape),
    /// A tube of bones in a row.
    Arm(ArmShape),
}

/// A human figure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FigureShape {
    /// Standing height, metres.
    pub height: f64,
    /// Factor on the thickness of torso and limbs.
    pub girth: f64,
    /// Factor on the distance between the shoulders.
    pub shoulders: f64,
    /// Factor on the length over which skinning weights change at a joint.
    pub softness: f64,
    /// Edge length of the mesh on torso and limbs, metres (face and hands are finer).
    pub edge: f64,
}

/// A tube of bones in a row along +X, for studies of single joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmShape {
    /// Number of bones.
    pub bones: u32,
    /// Length of all bones together, metres.
    pub length: f64,
    /// Radius, metres.
    pub radius: f64,
    /// Fraction of a bone over which skinning weights change at a joint, on either side.
    pub softness: f64,
    /// Edge length of the mesh, metres.
    pub edge: f64,
}

/// How the body moves. Angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Motion {
    /// Full turns of the subject in the training sequence.
    pub turns: f64,
    /// Largest twist: of the wrists and, by half of it, of the whole spine in the sequence `test_twist`; of every joint
    /// of an arm.
    pub twist_degrees: f64,
    /// Largest bend of elbows and knees in the sequence `test_bend`; of every joint of an arm.
    pub bend_degrees: f64,
    /// Factor on the movement of limbs during training; 0 holds an A-pose.
    pub liveliness: f64,
}

/// What the body looks like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Look {
    /// Pattern of the shirt.
    pub pattern: Pattern,
    /// Size of the pattern relative to its default (bands of 24 mm).
    pub pattern_scale: f64,
    /// Hue of the shirt, degrees.
    pub hue: f64,
    /// Hue of the trousers, degrees.
    pub trousers_hue: f64,
    /// Tone of the skin from dark (0) to light (1).
    pub skin: f64,
    /// Tone of the hair from dark (0) to light (1).
    pub hair: f64,
    /// Strength of every texture, 0 (plain colours) to 1.
    pub contrast: f64,
    /// Strength of the view-dependent reflections: 0 is matt, 1 natural, 2 wet.
    pub gloss: f64,
}

/// A pattern of cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    /// Bands around the body with fine lines.
    #[default]
    Stripes,
    /// A chess board with finer boards inside.
    Checks,
    /// Dots in staggered rows.
    Dots,
    /// Crossing translucent bands.
    Plaid,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            capture: Capture::Monocular,
            seed: 1,
            resolution: 512,
            samples: 3,
            train_frames: 60,
            test_frames: 20,
            train_cameras: 1,
            test_cameras: 1,
            lights: Lights::World,
            rig: Rig::Figure(FigureShape::default()),
            motion: Motion::default(),
            look: Look::default(),
        }
    }
}

impl Default for FigureShape {
    fn default() -> Self {
        Self { height: 1.74, girth: 1.0, shoulders: 1.0, softness: 1.0, edge: 0.021 }
    }
}

impl Default for ArmShape {
    fn default() -> Self {
        Self { bones: 2, length: 0.8, radius: 0.06, softness: 0.35, edge: 0.01 }
    }
}

impl Default for Motion {
    fn default() -> Self {
        Self { turns: 1.0, twist_degrees: 140.0, bend_degrees: 120.0, liveliness: 1.0 }
    }
}

impl Default for Look {
    fn default() -> Self {
        Self {
            pattern: Pattern::Stripes,
            pattern_scale: 1.0,
            hue: 10.0,
            trousers_hue: 220.0,
            skin: 0.6,
            hair: 0.15,
            contrast: 1.0,
            gloss: 1.0,
        }
    }
}

/// Name, value, least and largest accepted value of a field.
type Bound = (&'static str, f64, f64, f64);

impl Parameters {
    /// Checks every range.
    ///
    /// # Errors
    /// Names the first field that is out of range, as in the TOML ("rig.girth").
    pub fn validate(&self) -> Result<(), SceneError> {
        self.validate_counts()?;
        let Motion { turns, twist_degrees, bend_degrees, liveliness } = self.motion;
        let Look { pattern_scale, hue, trousers_hue, skin, hair, contrast, gloss, pattern: _ } = self.look;
        check(&[
            ("motion.turns", turns, -10.0, 10.0),
            ("motion.twist_degrees", twist_degrees, -180.0, 180.0),
            ("motion.bend_degrees", bend_degrees, 0.0, 150.0),
            ("motion.liveliness", liveliness, 0.0, 1.5),
            ("look.pattern_scale", pattern_scale, 0.1, 10.0),
            ("look.hue", hue, 0.0, 360.0),
            ("look.trousers_hue", trousers_hue, 0.0, 360.0),
            ("look.skin", skin, 0.0, 1.0),
            ("look.hair", hair, 0.0, 1.0),
            ("look.contrast", contrast, 0.0, 1.0),
            ("look.gloss", gloss, 0.0, 2.0),
        ])?;
        match self.rig {
            Rig::Figure(FigureShape { height, girth, shoulders, softness, edge }) => check(&[
                ("rig.height", height, 1.2, 2.2),
                ("rig.girth", girth, 0.85, 1.25),
                ("rig.shoulders", shoulders, 0.9, 1.1),
                ("rig.softness", softness, 0.3, 1.5),
                ("rig.edge", edge, 0.01, 0.025),
            ]),
            Rig::Arm(ArmShape { bones, length, radius, softness, edge }) => check(&[
                ("rig.bones", f64::from(bones), 1.0, 32.0),
                ("rig.length", length, 0.2, 3.0),
                ("rig.radius", radius, 0.02, length / 4.0),
                ("rig.softness", softness, 0.02, 0.5),
                ("rig.edge", edge, radius / 20.0, radius / 2.0),
            ]),
        }
    }

    fn validate_counts(&self) -> Result<(), SceneError> {
        check(&[
            ("resolution", f64::from(self.resolution), 16.0, f64::from(MAX_IMAGE_SIDE.min(4096))),
            ("samples", f64::from(self.samples), 1.0, 8.0),
            ("train_frames", f64::from(self.train_frames), 1.0, 10_000.0),
            ("test_frames", f64::from(self.test_frames), 1.0, 10_000.0),
            ("train_cameras", f64::from(self.train_cameras), 1.0, 64.0),
            ("test_cameras", f64::from(self.test_cameras), 1.0, 64.0),
        ])?;
        if self.capture != Capture::Multiview {
            for (field, cameras) in
                [("train_cameras", self.train_cameras), ("test_cameras", self.test_cameras)]
            {
                if cameras != 1 {
                    let problem = format!("{cameras} cameras");
                    return Err(SceneError::new(field, problem, "1 unless capture is \"multiview\""));
                }
            }
        }
        if self.capture == Capture::Hands && matches!(self.rig, Rig::Arm(_)) {
            return Err(SceneError::new(
                "rig.kind",
                "\"arm\" has no hands",
                "\"figure\" for capture \"hands\"",
            ));
        }
        Ok(())
    }

    /// A text that changes whenever any image would: the generator's version and a digest of all parameters.
    ///
    /// # Panics
    /// Never: parameters are plain numbers and names, which JSON can hold.
    pub fn key(&self) -> String {
        let text = serde_json::to_string(self).expect("parameters are plain data");
        let digest = Sha256::digest(text.as_bytes());
        let hex: String = digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect();
        format!("synthetic-v{GENERATOR_VERSION}-{hex}")
    }
}

fn check(bounds: &[Bound]) -> Result<(), SceneError> {
    match bounds.iter().find(|&&(_, value, low, high)| !(value >= low && value <= high)) {
        None => Ok(()),
        Some((field, value, low, high)) => {
            Err(SceneError::new(*field, value.to_string(), format!("a number from {low} to {high}")))
        }
    }
}
