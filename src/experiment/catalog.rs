//! Protocols and strategies by their specs: the one place where experiments meet the layers that define them.

use skinsplat_metrics::{MetricsError, Protocol};
use skinsplat_posing::{PosingError, Strategy};

/// The protocol of a spec.
///
/// # Errors
/// What is wrong with the spec, and what is known.
pub(super) fn protocol(spec: &str) -> Result<Protocol, (String, String)> {
    Protocol::parse(spec).map_err(|error| match error {
        MetricsError::Protocol { problem, expected, .. } => (format!("`{spec}`: {problem}"), expected),
        other => (format!("`{spec}`: {other}"), "a valid protocol".to_owned()),
    })
}

/// The strategy of a spec.
///
/// # Errors
/// What is wrong with the spec, and what is known.
pub(super) fn strategy(spec: &str) -> Result<Strategy, (String, String)> {
    spec.parse().map_err(|error| explained(spec, error))
}

fn explained(spec: &str, error: PosingError) -> (String, String) {
    match error {
        PosingError::UnknownId { axis, id, expected } => (format!("unknown {axis} `{id}`"), expected),
        PosingError::BadVariation { part, expected } => (format!("`{part}`"), expected),
        other => (format!("`{spec}`: {other}"), "a valid strategy".to_owned()),
    }
}
