//! Values by metric.

use super::MetricId;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

/// A value for some of the metrics. In JSON an object by name, in which `null` is +inf (the PSNR of identical images); a
/// metric that has no value is not in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Values(BTreeMap<MetricId, f64>);

impl Values {
    /// The value of a metric.
    pub fn get(&self, id: MetricId) -> Option<f64> {
        self.0.get(&id).copied()
    }

    /// Sets the value of a metric.
    pub fn insert(&mut self, id: MetricId, value: f64) {
        self.0.insert(id, value);
    }

    /// Metrics and values, in the order of [`METRICS`](super::METRICS).
    pub fn iter(&self) -> impl Iterator<Item = (MetricId, f64)> {
        self.0.iter().map(|(&id, &value)| (id, value))
    }
}

impl FromIterator<(MetricId, f64)> for Values {
    fn from_iter<I: IntoIterator<Item = (MetricId, f64)>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

impl Serialize for Values {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(id, value)| (id, value.is_finite().then_some(value))))
    }
}

impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let values: BTreeMap<MetricId, Option<f64>> = BTreeMap::deserialize(deserializer)?;
        Ok(values.into_iter().map(|(id, value)| (id, value.unwrap_or(f64::INFINITY))).collect())
    }
}
