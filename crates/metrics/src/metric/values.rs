//! Values by metric.

use super::MetricId;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
use std::collections::BTreeMap;

/// A value for some of the metrics. In JSON an object by name, in which `null` is +inf (the PSNR of identical images, and of
/// none but [`MetricId::can_be_infinite`]); a metric that has no value is not in it.
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
        let value = |(id, value): (MetricId, Option<f64>)| match value {
            Some(value) => Ok((id, value)),
            None if id.can_be_infinite() => Ok((id, f64::INFINITY)),
            None => {
                let expected = "a number: only PSNR can be infinite, and what was not computed is left out";
                Err(D::Error::custom(format!("`{id:?}` is null, expected {expected}")))
            }
        };
        values.into_iter().map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_can_be_infinite_is_null() {
        let read = |text: &str| serde_json::from_str::<Values>(text);
        let values = read(r#"{ "psnr": null, "psnr-bent": null, "ssim": 1.0 }"#).unwrap();
        assert_eq!(
            (values.get(MetricId::PSNR), values.get(MetricId::SSIM)),
            (Some(f64::INFINITY), Some(1.0))
        );
        for metric in ["ssim", "lpips", "mae", "splats"] {
            let error = read(&format!("{{ \"psnr\": 30.0, \"{metric}\": null }}")).unwrap_err().to_string();
            assert!(error.contains(&format!("`{metric}` is null, expected a number")), "{error}");
        }
    }
}
