//! Only what a scene requires, measured: what it costs to do all, what it costs to do what is needed, and whether the result
//! is the same.
//!
//! [`measure`] runs each pair on a subject that is built in: an avatar made from a few of its training frames, its test
//! motion, its camera. Times are of one thread and differ from run to run; everything else does not.

mod rows;
mod scene;
mod scores;
mod section;

pub use scene::Options;
pub use section::{ID, section};

use super::{Error, Spread};
use serde::Serialize;

/// One thing that is left out where it is not needed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Saving {
    /// What is left out, and when.
    pub what: String,
    /// What one unit of the times is: a frame, a pose, a Gaussian-free step.
    pub unit: &'static str,
    /// The cost of doing it all.
    pub without: Spread,
    /// The cost of doing what is needed.
    pub with: Spread,
    /// What became of the result.
    pub result: Same,
}

impl Saving {
    /// How many times faster.
    pub fn factor(&self) -> f64 {
        self.without.median / self.with.median
    }
}

/// How the results compare.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Same {
    /// Every bit.
    Identical,
    /// Largest difference, at most what is allowed.
    Within {
        /// What was found.
        largest: f64,
        /// What is claimed.
        allowed: f64,
        /// Of what, in which unit.
        of: &'static str,
    },
    /// They differ by more than is claimed: a defect.
    Different {
        /// What was found.
        largest: f64,
        /// What is claimed.
        allowed: f64,
        /// Of what, in which unit.
        of: &'static str,
    },
}

impl std::fmt::Display for Same {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Identical => f.write_str("identical"),
            Self::Within { largest, allowed, of } => {
                write!(f, "within {largest:.2e} {of} (claimed {allowed:.2e})")
            }
            Self::Different { largest, allowed, of } => {
                write!(f, "off by {largest:.2e} {of} (claimed {allowed:.2e})")
            }
        }
    }
}

/// Measures every saving, in the order of the road: body, pose, colour, image, frames, metrics. In under 40 seconds with the
/// default options.
///
/// # Errors
/// Options that leave no frame.
pub fn measure(options: &Options) -> Result<Vec<Saving>, Error> {
    let scene = scene::Scene::new(options)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    match pool {
        Ok(pool) => pool.install(|| rows::all(&scene, options)),
        // Without a thread of its own it is measured on the caller's: slower, not wrong.
        Err(_) => rows::all(&scene, options),
    }
}
