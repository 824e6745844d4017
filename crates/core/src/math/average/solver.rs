//! The solvers by name.

use std::fmt;
use std::str::FromStr;

/// The start vector of a power iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Start {
    /// The bone of largest weight, the first of equals. The default: never orthogonal to A's range, and the best single
    /// bone.
    #[default]
    Heaviest,
    /// The first bone with a weight.
    First,
    /// (1, 1, 1, 1)/2: needs no data, and can be orthogonal to the answer.
    Ones,
    /// (1, 0, 0, 0): needs no data, and is orthogonal to every half turn.
    Identity,
    /// The normalised sum, aligned to the heaviest bone ([`Solver::Nlerp`]).
    Nlerp,
    /// The column of A with the largest diagonal entry, which is what PyTorch3D's matrix-to-quaternion reads.
    LargestColumn,
}

impl Start {
    /// Every start with its name in a solver id.
    const NAMES: [(Self, &'static str); 6] = [
        (Self::Heaviest, "heaviest"),
        (Self::First, "first"),
        (Self::Ones, "ones"),
        (Self::Identity, "identity"),
        (Self::Nlerp, "nlerp"),
        (Self::LargestColumn, "column"),
    ];
}

/// How the average of rotations is computed. Written as an id: `closed-form`, `eigen`, `polar`, `power-15`,
/// `power-15-ones` (also `-first`, `-identity`, `-nlerp`, `-column`, `-heaviest`; the last is the default and is left
/// out), `squaring-4`, `nlerp`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "String", into = "String"))]
pub enum Solver {
    /// Exact and fastest: nothing for one bone, a formula for two, repeated squaring certified to have converged for
    /// more (Jacobi where it has not). In `f64` for both precisions.
    #[default]
    ClosedForm,
    /// Exact: the leading eigenvector of Σ w q qᵀ by cyclic Jacobi.
    Eigen,
    /// Exact: the proper rotation nearest to Σ w R(q), by the singular value decomposition.
    Polar,
    /// Power iteration with a fixed number of steps; the paper's engine path takes 15. Wrong near 180°.
    Power {
        /// Number of multiplications by A.
        steps: u32,
        /// Where it starts.
        start: Start,
    },
    /// Squares A a fixed number of times: 2^doublings power steps without a start vector.
    Squaring {
        /// Number of squarings.
        doublings: u32,
    },
    /// The normalised weighted sum of quaternions brought to the side of the heaviest bone. An approximation for three
    /// bones or more, and for unequal weights.
    Nlerp,
}

impl Solver {
    /// The forms that ids take, each with what it is in a line.
    pub const FORMS: [(&'static str, &'static str); 6] = [
        ("closed-form", "the exact average, fastest: a formula for two bones, certified squaring for more"),
        ("eigen", "the exact average, by cyclic Jacobi"),
        ("polar", "the exact average, by the singular value decomposition of the blended matrix"),
        ("nlerp", "the normalised sum of quaternions on the heaviest bone's side"),
        (
            "power-N[-START]",
            "N power steps from START: heaviest (if none is named), first, ones, identity, nlerp, column",
        ),
        ("squaring-N", "2^N power steps without a start, by squaring"),
    ];
}

/// The largest number of steps or doublings that an id may ask for.
const STEP_LIMIT: u32 = 100_000;

/// Not a solver id.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParseSolverError(String);

impl fmt::Display for ParseSolverError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "`{}` is not a solver: expected closed-form, eigen, polar, nlerp, power-N[-heaviest|-first|-ones|-identity|\
             -nlerp|-column] or squaring-N with N at most {STEP_LIMIT}",
            self.0
        )
    }
}

impl std::error::Error for ParseSolverError {}

impl fmt::Display for Solver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::ClosedForm => f.write_str("closed-form"),
            Self::Eigen => f.write_str("eigen"),
            Self::Polar => f.write_str("polar"),
            Self::Nlerp => f.write_str("nlerp"),
            Self::Squaring { doublings } => write!(f, "squaring-{doublings}"),
            Self::Power { steps, start: Start::Heaviest } => write!(f, "power-{steps}"),
            Self::Power { steps, start } => {
                let name =
                    Start::NAMES.iter().find(|(other, _)| *other == start).map_or("", |(_, name)| name);
                write!(f, "power-{steps}-{name}")
            }
        }
    }
}

impl FromStr for Solver {
    type Err = ParseSolverError;

    fn from_str(id: &str) -> Result<Self, Self::Err> {
        let error = || ParseSolverError(id.to_owned());
        let number = |text: &str| {
            let plain = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
            let value = text.parse::<u32>().ok().filter(|&n| plain && n <= STEP_LIMIT);
            value.ok_or_else(error)
        };
        match id {
            "closed-form" => return Ok(Self::ClosedForm),
            "eigen" => return Ok(Self::Eigen),
            "polar" => return Ok(Self::Polar),
            "nlerp" => return Ok(Self::Nlerp),
            _ => {}
        }
        if let Some(doublings) = id.strip_prefix("squaring-") {
            return Ok(Self::Squaring { doublings: number(doublings)? });
        }
        let power = id.strip_prefix("power-").ok_or_else(error)?;
        let (steps, name) = power.split_once('-').unwrap_or((power, "heaviest"));
        let (start, _) = Start::NAMES.iter().find(|(_, other)| *other == name).ok_or_else(error)?;
        Ok(Self::Power { steps: number(steps)?, start: *start })
    }
}

impl TryFrom<String> for Solver {
    type Error = ParseSolverError;

    fn try_from(id: String) -> Result<Self, Self::Error> {
        id.parse()
    }
}

impl From<Solver> for String {
    fn from(solver: Solver) -> Self {
        solver.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_round_trip() {
        let fixed = ["closed-form", "eigen", "polar", "nlerp", "squaring-4", "power-15"].map(str::to_owned);
        let starts = Start::NAMES.iter().skip(1).map(|(_, name)| format!("power-7-{name}"));
        for id in fixed.into_iter().chain(starts) {
            let solver: Solver = id.parse().unwrap();
            assert_eq!(solver.to_string(), id);
        }
        let default = Solver::Power { steps: 15, start: Start::Heaviest };
        assert_eq!("power-15-heaviest".parse(), Ok(default));
    }

    #[cfg(feature = "serde")]
    #[test]
    fn serialised_as_ids() {
        for id in ["closed-form", "power-15", "power-7-ones", "squaring-4"] {
            let solver: Solver = id.parse().unwrap();
            let json = serde_json::to_string(&solver).unwrap();
            assert_eq!(json, format!("\"{id}\""));
            assert_eq!(serde_json::from_str::<Solver>(&json).unwrap(), solver);
        }
    }

    #[test]
    fn other_ids_are_refused_by_name() {
        for id in ["", "Eigen", "power", "power-", "power-+1", "power-1-", "power-1-zero", "squaring-100001"]
        {
            let error = id.parse::<Solver>().unwrap_err().to_string();
            assert!(error.contains(&format!("`{id}`")), "{error}");
        }
    }
}
