//! Strategies as text: `PRESET` or `PRESET+axis=choice+axis=choice`, for instance
//! `quaternion-average+rotation=power-15+colour=none`.

use super::{
    ClampChoice, ColourChoice, CovarianceChoice, PRESETS, PosingError, Preset, RotationChoice, Strategy,
};
use skinsplat_core::math::average::Solver;
use std::fmt;
use std::str::FromStr;

const AXES: [&str; 4] = ["rotation", "covariance", "colour", "clamp"];

impl FromStr for Strategy {
    type Err = PosingError;

    fn from_str(spec: &str) -> Result<Self, PosingError> {
        let mut parts = spec.split('+');
        let id = parts.next().unwrap_or_default();
        let mut strategy = Self::preset(id).ok_or_else(|| PosingError::UnknownId {
            axis: "strategy",
            id: id.to_owned(),
            expected: PRESETS.iter().map(|preset| preset.id).collect::<Vec<_>>().join(", "),
        })?;
        let mut seen = Vec::new();
        for part in parts {
            let bad = |expected: String| PosingError::BadVariation { part: part.to_owned(), expected };
            let (axis, id) = part.split_once('=').ok_or_else(|| bad("axis=choice".into()))?;
            if seen.contains(&axis) {
                return Err(bad(format!("{axis} once")));
            }
            match axis {
                "rotation" => strategy.rotation = id.parse()?,
                "covariance" => strategy.covariance = id.parse()?,
                "colour" => strategy.colour = id.parse()?,
                "clamp" => strategy.clamp = id.parse()?,
                _ => return Err(bad(format!("one of the axes {}", AXES.join(", ")))),
            }
            seen.push(axis);
        }
        Ok(strategy)
    }
}

/// What may follow a preset in the text of a strategy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variation {
    /// `axis=choice`; a parameter of the choice is in capitals.
    pub spec: String,
    /// What it is, in a line.
    pub summary: &'static str,
}

/// Every choice of every axis.
pub fn variations() -> Vec<Variation> {
    let of = |axis: &str, id: &dyn fmt::Display, summary| Variation { spec: format!("{axis}={id}"), summary };
    let [rotation, covariance, colour, clamp] = AXES;
    let solvers = Solver::FORMS.map(|(form, summary)| of(rotation, &form, summary));
    let named = RotationChoice::NAMED.map(|named| of(rotation, &named.id, named.summary));
    let vertices =
        of(rotation, &"vertex-average-SOLVER", "vertex-average with another solver of the average");
    let covariances = CovarianceChoice::ALL.map(|choice| of(covariance, &choice, choice.summary()));
    let colours = ColourChoice::ALL.map(|choice| of(colour, &choice, choice.summary()));
    let clamps = ClampChoice::ALL.map(|choice| of(clamp, &choice, choice.summary()));
    let rotations = solvers.into_iter().chain(named).chain([vertices]);
    rotations.chain(covariances).chain(colours).chain(clamps).collect()
}

/// The axes as text, in the order of [`AXES`].
fn ids(strategy: &Strategy) -> [String; 4] {
    let Strategy { rotation, covariance, colour, clamp } = strategy;
    [rotation.to_string(), covariance.to_string(), colour.to_string(), clamp.to_string()]
}

/// The preset to describe a strategy by: itself if it is one (else none of an engine), one with the same kind of rotation if there is one, then the one that differs
/// on the fewest axes, then the first.
fn nearest_preset(strategy: &Strategy) -> &'static Preset {
    let distance = |preset: &&Preset| {
        let kind = |s: &Strategy| std::mem::discriminant(&s.rotation);
        let differing = ids(&preset.strategy).iter().zip(ids(strategy)).filter(|(a, b)| *a != b).count();
        // What an engine does is named by itself alone, not as a start for something else.
        (preset.is_engine() && differing > 0, kind(&preset.strategy) != kind(strategy), differing)
    };
    PRESETS.iter().min_by_key(distance).expect("there are presets")
}

impl fmt::Display for Strategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let preset = nearest_preset(self);
        f.write_str(preset.id)?;
        for ((axis, base), own) in AXES.iter().zip(ids(&preset.strategy)).zip(ids(self)) {
            if base != own {
                write!(f, "+{axis}={own}")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_print_as_their_id() {
        for preset in PRESETS {
            assert_eq!(preset.strategy.to_string(), preset.id);
            assert_eq!(preset.id.parse::<Strategy>().unwrap(), preset.strategy);
        }
    }

    #[test]
    fn every_combination_round_trips() {
        let solvers = ["closed-form", "eigen", "polar", "power-15", "power-3", "nlerp"];
        let mut rotations: Vec<RotationChoice> = RotationChoice::named().collect();
        for solver in solvers {
            rotations.push(solver.parse().unwrap());
            rotations.push(format!("vertex-average-{solver}").parse().unwrap());
        }
        for rotation in rotations {
            for covariance in CovarianceChoice::ALL {
                for colour in ColourChoice::ALL {
                    for clamp in ClampChoice::ALL {
                        let strategy = Strategy { rotation, covariance, colour, clamp };
                        assert_eq!(strategy.to_string().parse::<Strategy>().unwrap(), strategy, "{strategy}");
                        #[cfg(feature = "serde")]
                        {
                            let json = serde_json::to_string(&strategy).unwrap();
                            assert_eq!(serde_json::from_str::<Strategy>(&json).unwrap(), strategy, "{json}");
                        }
                    }
                }
            }
        }
        let spec = "quaternion-average+rotation=power-15+colour=none";
        assert_eq!(spec.parse::<Strategy>().unwrap().to_string(), spec);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn serde_names_are_the_ids() {
        for choice in CovarianceChoice::ALL {
            assert_eq!(serde_json::to_string(&choice).unwrap(), format!("\"{choice}\""));
        }
        for choice in ColourChoice::ALL {
            assert_eq!(serde_json::to_string(&choice).unwrap(), format!("\"{choice}\""));
        }
        for choice in ClampChoice::ALL {
            assert_eq!(serde_json::to_string(&choice).unwrap(), format!("\"{choice}\""));
        }
    }

    #[test]
    fn every_variation_can_be_asked_for() {
        let parameters = [("SOLVER", "eigen"), ("[-START]", "-ones"), ("N", "3")];
        let all = variations();
        assert!(RotationChoice::named().all(|r| all.iter().any(|v| v.spec == format!("rotation={r}"))));
        for Variation { spec, summary } in all {
            let filled =
                parameters.iter().fold(spec.clone(), |text, (name, value)| text.replace(name, value));
            assert!(format!("lbs+{filled}").parse::<Strategy>().is_ok(), "{spec}");
            assert!(!summary.is_empty(), "{spec}");
        }
    }

    #[test]
    fn errors_say_what_is_known() {
        for (spec, part, known) in [
            ("lbz", "\"lbz\"", "dual-quaternion"),
            ("", "\"\"", "lbs"),
            ("lbs+rotation=spin", "\"spin\"", "gram-schmidt-rows"),
            ("lbs+rotation=spin", "\"spin\"", "closed-form"),
            ("lbs+colour=red", "\"red\"", "rotate-sh"),
            ("lbs+covariance", "\"covariance\"", "axis=choice"),
            ("lbs+hue=red", "\"hue=red\"", "clamp"),
            ("lbs+colour=none+colour=none", "\"colour=none\"", "once"),
        ] {
            let message = spec.parse::<Strategy>().unwrap_err().to_string();
            assert!(message.contains(part) && message.contains(known), "{spec}: {message}");
        }
    }
}
