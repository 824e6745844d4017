//! `--tolerance-METRIC` for every metric of [`MetricId::all`].

use super::compare::COMPARISON;
use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches};
use skinsplat::report::compare::Allowed;
use skinsplat_metrics::MetricId;

/// How far numbers may move, by options that are named after the metrics; what was not given is not in it.
#[derive(Debug)]
pub(super) struct ToleranceOptions(pub(super) Allowed);

fn name(metric: MetricId) -> String {
    format!("tolerance-{}", metric.id())
}

fn option(metric: MetricId) -> Arg {
    let known = metric.metric();
    let unit = if known.unit.is_empty() { String::new() } else { format!(", {}", known.unit) };
    let worse = if known.higher_is_better { "lost" } else { "gained" };
    let value_name = if known.unit.is_empty() { "X".to_owned() } else { known.unit.to_uppercase() };
    Arg::new(name(metric))
        .long(name(metric))
        .value_name(value_name)
        .value_parser(tolerance)
        .help(format!("{} that may be {worse}{unit} [default: {}]", known.title, known.tolerance))
        .help_heading(COMPARISON)
}

fn tolerance(text: &str) -> Result<f64, String> {
    let named = text.trim_start_matches('+').to_ascii_lowercase();
    match text.parse::<f64>() {
        // Beyond all numbers only where that is said: 1e400 is a slip.
        Ok(value) if value >= 0.0 && (value.is_finite() || named.starts_with("inf")) => Ok(value),
        _ => Err("expected a number that is not negative, or inf".to_owned()),
    }
}

impl Args for ToleranceOptions {
    fn augment_args(command: Command) -> Command {
        command.args(MetricId::all().map(option))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for ToleranceOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let given = |metric| Some((metric, *matches.get_one(&name(metric))?));
        Ok(Self(Allowed(MetricId::all().filter_map(given).collect())))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}
