//! `--tolerance-METRIC` for every metric of [`MetricId::all`].

use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches, value_parser};
use skinsplat::report::compare::Tolerances;
use skinsplat_metrics::MetricId;

/// How far numbers may move, by options that are named after the metrics.
#[derive(Debug)]
pub(super) struct ToleranceOptions(pub(super) Tolerances);

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
        .value_parser(value_parser!(f64))
        .default_value(known.tolerance.to_string())
        .help(format!("{} that may be {worse}{unit}", known.title))
        .help_heading("Comparison")
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
        let given = |metric| matches.get_one(&name(metric)).copied().unwrap_or_default();
        Ok(Self(Tolerances::each(given)))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}
