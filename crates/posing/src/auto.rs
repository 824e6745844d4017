//! `auto:TOLERANCE`: the cheapest rotation that is provably within a tolerance of the exact average, chosen anew for each
//! pose from [`PoseBounds`].

use super::needs::{PoseBounds, rounding};
use super::{BoundAvatar, ColourChoice, RotationChoice, Strategy, StrategyError};
use serde::{Serialize, Serializer};
use skinsplat_core::math::average::{Solver, Start};
use skinsplat_core::scene::PosedBody;
use std::fmt;
use std::str::FromStr;

/// A strategy as asked for: one, or a tolerance and what else is fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Choice {
    /// This strategy in every pose.
    Fixed(Strategy),
    /// The cheapest within a tolerance.
    Auto(Auto),
}

/// A tolerance, and the axes that it leaves alone. Written `auto:0.5` or `auto:0.5+colour=none`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Auto {
    /// Degrees by which no Gaussian's rotation may differ from the exact average.
    pub tolerance: f64,
    /// The other axes; its rotation is the exact one.
    pub base: Strategy,
    /// The colour was not asked for by name: SH need not be rotated if turning the view direction costs less.
    pub colour_is_free: bool,
}

/// From how many sides a pose is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Views {
    /// So many.
    Few(usize),
    /// Any number, and by programs that know nothing of view frames: SH have to be rotated.
    Any,
}

/// What was chosen for a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolved {
    /// The strategy.
    pub strategy: Strategy,
    /// At least the angle in degrees by which any Gaussian's rotation differs from the exact average; none for a strategy
    /// that was given.
    pub bound: Option<f64>,
}

/// What [`Auto`] chooses from, in the order in which it tries them, with nanoseconds per Gaussian as measured (`cargo bench
/// --bench posing -- candidates`, 100,000 Gaussians without SH, one core; medians of four runs spread by 2 either way). The
/// normalised sum took 40 there, every other solver 75 and more: the exact average is cheaper than both. An order, not a
/// clock: the choice depends on avatar, pose and tolerance alone.
pub const CANDIDATES: [(RotationChoice, f64); 2] = [
    (RotationChoice::QuaternionAverage(Solver::Power { steps: 0, start: Start::Heaviest }), 34.0),
    (RotationChoice::QuaternionAverage(Solver::ClosedForm), 38.0),
];

/// Views of one pose up to which the view direction is turned in place of SH of a degree. Rotating degree 3 costs about 100
/// nanoseconds per Gaussian and pose; the other costs are estimates: turning a direction is nine multiplications a view.
const VIEWS_WORTH: [usize; 4] = [0, 8, 16, 32];

impl Choice {
    /// The strategy for a pose.
    ///
    /// # Errors
    /// [`StrategyError::Tolerance`] if not even the exact average is certain to be within the tolerance in this pose.
    pub fn resolve(
        &self,
        bound: &BoundAvatar,
        body: &PosedBody<'_>,
        views: Views,
    ) -> Result<Resolved, StrategyError> {
        match self {
            Self::Fixed(strategy) => Ok(Resolved { strategy: *strategy, bound: None }),
            Self::Auto(auto) => auto.resolve(bound, body, views),
        }
    }
}

impl Auto {
    /// The smallest tolerance that any pose can keep, degrees: what `f32` leaves of one bone.
    pub fn smallest() -> f64 {
        rounding::STORED.to_degrees()
    }

    /// A tolerance from text.
    ///
    /// # Errors
    /// What was expected: a number that is not too small for any pose.
    pub fn parse_tolerance(text: &str) -> Result<f64, String> {
        let usable = |degrees: &f64| degrees.is_finite() && *degrees >= Self::smallest();
        text.parse().ok().filter(usable).ok_or_else(|| {
            format!("a tolerance in degrees such as 0.5, finite and at least {:.2e}", Self::smallest())
        })
    }

    fn resolve(
        &self,
        bound: &BoundAvatar,
        body: &PosedBody<'_>,
        views: Views,
    ) -> Result<Resolved, StrategyError> {
        bound.check_body(body)?;
        let bounds = PoseBounds::new(bound, body);
        let mut reachable = f64::INFINITY;
        for (rotation, _) in CANDIDATES {
            let degrees = bounds.degrees(rotation);
            if degrees <= self.tolerance {
                let colour = self.colour(bound.sh_degree, views);
                let strategy = Strategy { rotation, colour, ..self.base };
                return Ok(Resolved { strategy, bound: Some(degrees) });
            }
            reachable = reachable.min(degrees);
        }
        Err(StrategyError::Tolerance { asked: self.tolerance, reachable, place: "in this pose" })
    }

    /// Rotated SH and a turned view direction look the same but for rounding.
    fn colour(&self, degree: usize, views: Views) -> ColourChoice {
        let few = matches!(views, Views::Few(n) if n <= VIEWS_WORTH[degree]);
        match self.base.colour {
            ColourChoice::RotateSh if self.colour_is_free && few => ColourChoice::ViewRotation,
            colour => colour,
        }
    }
}

/// The name before the tolerance.
const NAME: &str = "auto:";

/// What the other axes vary.
const BASE: &str = "quaternion-average";

impl FromStr for Choice {
    type Err = StrategyError;

    fn from_str(spec: &str) -> Result<Self, StrategyError> {
        let Some(rest) = spec.strip_prefix(NAME) else { return Ok(Self::Fixed(spec.parse()?)) };
        let (number, variations) = rest.split_once('+').map_or((rest, None), |(n, v)| (n, Some(v)));
        let bad = |expected: &str| {
            let part = format!("{NAME}{number}");
            StrategyError::BadVariation { part, expected: expected.to_owned() }
        };
        let tolerance = Auto::parse_tolerance(number).map_err(|expected| bad(&expected))?;
        let parts: Vec<&str> = variations.map(|v| v.split('+').collect()).unwrap_or_default();
        let asks = |axis: &str| parts.iter().find(|part| part.split('=').next() == Some(axis));
        if let Some(part) = asks("rotation") {
            let expected = "other axes than the rotation, which auto picks".to_owned();
            return Err(StrategyError::BadVariation { part: (*part).to_owned(), expected });
        }
        let base = match variations {
            Some(variations) => format!("{BASE}+{variations}").parse()?,
            None => BASE.parse()?,
        };
        Ok(Self::Auto(Auto { tolerance, base, colour_is_free: asks("colour").is_none() }))
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(strategy) => write!(f, "{strategy}"),
            Self::Auto(auto) => {
                write!(f, "{NAME}{}", auto.tolerance)?;
                let base = auto.base.to_string();
                let variations = base.strip_prefix(BASE).unwrap_or_default();
                f.write_str(variations)?;
                let default = base.parse::<Strategy>().is_ok_and(|b| b.colour == ColourChoice::RotateSh);
                if !auto.colour_is_free && default { write!(f, "+colour=rotate-sh") } else { Ok(()) }
            }
        }
    }
}

impl Serialize for Choice {
    /// A fixed strategy as itself, so that content keys do not depend on how it was asked for.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Fixed(strategy) => strategy.serialize(serializer),
            Self::Auto(_) => serializer.collect_str(self),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_round_trips() {
        for spec in
            ["auto:0.5", "auto:0.5+colour=none", "auto:2+colour=rotate-sh", "auto:0.001+clamp=unit", "lbs"]
        {
            let choice: Choice = spec.parse().unwrap();
            assert_eq!(choice.to_string(), spec);
            assert_eq!(choice.to_string().parse::<Choice>().unwrap(), choice);
        }
    }

    #[test]
    fn fixed_strategies_serialise_as_themselves() {
        let strategy: Strategy = "lbs+colour=rotate-sh".parse().unwrap();
        let plain = serde_json::to_string(&strategy).unwrap();
        assert_eq!(serde_json::to_string(&Choice::Fixed(strategy)).unwrap(), plain);
    }

    #[test]
    fn impossible_tolerances_name_the_smallest() {
        let smallest = format!("{:.2e}", Auto::smallest());
        for spec in ["auto:0", "auto:-1", "auto:nan", "auto:inf", "auto:1e-9"] {
            let message = spec.parse::<Choice>().unwrap_err().to_string();
            assert!(message.contains(&smallest), "{spec}: {message}");
        }
        for (spec, known) in
            [("auto:", "0.5"), ("auto:x", "degrees"), ("auto:1+rotation=nlerp", "auto picks")]
        {
            let message = spec.parse::<Choice>().unwrap_err().to_string();
            assert!(message.contains(known), "{spec}: {message}");
        }
    }

    #[test]
    fn candidates_are_in_order_of_cost() {
        assert!(CANDIDATES.is_sorted_by(|(_, a), (_, b)| a < b));
    }
}
