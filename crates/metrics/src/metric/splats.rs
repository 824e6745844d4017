//! Number of Gaussians.

use super::{Measure, Metric};

pub(super) const METRIC: Metric = Metric {
    id: "splats",
    title: "Splats",
    unit: "",
    summary: "Gaussians of the avatar; fewer count as better, as in the paper's Table 3",
    higher_is_better: false,
    decimals: 0,
    tolerance: 0.0,
    needs: "",
    measure: Measure::Avatar(|avatar| avatar.gaussians.map(|count| count as f64)),
};
