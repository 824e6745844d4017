//! Up to which difference two variants are as good as each other.

use super::{Error, Experiment};
use skinsplat_metrics::MetricId;

/// The usual margins: 0.05 dB is 1.2 % of the squared error, and 0.0005 is as much of the 0.03 to 0.05 that SSIM lacks of 1 and that
/// LPIPS has on renders of avatars. Of a metric over a part of the image (`psnr-bent`) it is that of the metric.
const USUAL: [(MetricId, f64); 3] =
    [(MetricId::PSNR, 0.05), (MetricId::SSIM, 0.0005), (MetricId::LPIPS, 0.0005)];

impl Experiment {
    /// The margin X of "no difference above X", in units of the metric: the experiment's, or the usual one; 0, so that every
    /// difference counts, for a metric that has neither.
    pub fn margin(&self, metric: MetricId) -> f64 {
        let whole = metric.id().split('-').next();
        let usual = || USUAL.iter().find(|(of, _)| Some(of.id()) == whole).map(|(_, margin)| *margin);
        self.equivalence.get(&metric).copied().or_else(usual).unwrap_or(0.0)
    }
}

/// Checks `equivalence`.
pub(super) fn check(e: &Experiment, file: &str) -> Result<(), Error> {
    for (metric, &margin) in &e.equivalence {
        let key = format!("equivalence.{}", metric.id());
        if !metric.is_of_frames() {
            return Err(Error::invalid(file, key, "a margin", "none: frames do not differ in it"));
        }
        if !(margin.is_finite() && margin >= 0.0) {
            return Err(Error::invalid(file, key, format!("{margin}"), "a finite number, not negative"));
        }
    }
    Ok(())
}
