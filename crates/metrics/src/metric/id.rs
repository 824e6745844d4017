//! Names of metrics.

use super::{METRICS, Measure, Metric};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A metric of [`METRICS`]. In files it is the metric's name; ids are ordered as [`METRICS`] is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MetricId(u8);

/// The name of every metric.
const IDS: [&str; METRICS.len()] = {
    let mut ids = [""; METRICS.len()];
    let mut i = 0;
    while i < ids.len() {
        ids[i] = METRICS[i].id;
        i += 1;
    }
    ids
};

impl MetricId {
    /// Peak signal-to-noise ratio, dB.
    pub const PSNR: Self = Self::named("psnr");
    /// Structural similarity.
    pub const SSIM: Self = Self::named("ssim");
    /// Learned perceptual distance.
    pub const LPIPS: Self = Self::named("lpips");
    /// Number of Gaussians of the avatar.
    pub const SPLATS: Self = Self::named("splats");

    /// Change from frame to frame that the truth does not have.
    pub const FLICKER: Self = Self::named("flicker");
    /// Gaussians whose rotation jumps from frame to frame.
    pub const ROTATION_JUMPS: Self = Self::named("rotation-jumps");

    /// All of them, in the order of [`METRICS`].
    pub fn all() -> impl DoubleEndedIterator<Item = Self> + Clone {
        (0..METRICS.len() as u8).map(Self)
    }

    /// Those of a render and its truth.
    pub fn of_frames() -> impl DoubleEndedIterator<Item = Self> + Clone {
        Self::all().filter(|id| id.is_of_frames())
    }

    /// Those of a render and its truth that need neither the posed body nor another frame.
    pub fn of_images() -> impl DoubleEndedIterator<Item = Self> + Clone {
        Self::of_frames().filter(|id| !id.needs_bend() && !id.needs_before())
    }

    /// The metric of this name.
    pub fn from_id(id: &str) -> Option<Self> {
        Self::all().find(|metric| metric.id() == id)
    }

    /// What is known about it.
    pub fn metric(self) -> &'static Metric {
        &METRICS[usize::from(self.0)]
    }

    /// Stable name in files.
    pub fn id(self) -> &'static str {
        self.metric().id
    }

    /// Column title.
    pub fn title(self) -> &'static str {
        self.metric().title
    }

    /// Digits after the point.
    pub fn decimals(self) -> usize {
        self.metric().decimals
    }

    /// Whether more is better.
    pub fn higher_is_better(self) -> bool {
        self.metric().higher_is_better
    }

    /// Whether it asks by how much the body is bent where a pixel shows it: [`Wanted::bend`](crate::Wanted::bend).
    pub fn needs_bend(self) -> bool {
        self.metric().needs == super::bend::NEEDS
    }

    /// Whether it asks for the frame before: [`Wanted::before`](crate::Wanted::before).
    pub fn needs_before(self) -> bool {
        self.metric().needs == super::motion::NEEDS
    }

    /// The angles between joints of the pixels that it is taken over, if it is one of the metrics that share out the body by
    /// them: from the first on and below the second, degrees.
    pub fn bend_class(self) -> Option<[u32; 2]> {
        super::bend::CLASSES.iter().find(|(id, _)| *id == self.id()).map(|&(_, class)| class)
    }

    /// Whether it can be +inf, as it is of identical images: only what is a logarithm of an error can, in decibels.
    pub fn can_be_infinite(self) -> bool {
        self.metric().unit == "dB"
    }

    /// Whether each frame has a value of its own; the others are of the avatar.
    pub fn is_of_frames(self) -> bool {
        matches!(self.metric().measure, Measure::Frame { .. })
    }

    /// The metric of this name, found when the program is compiled.
    const fn named(id: &str) -> Self {
        let mut i = 0;
        while i < IDS.len() {
            if same(IDS[i].as_bytes(), id.as_bytes()) {
                return Self(i as u8);
            }
            i += 1;
        }
        panic!("no metric of this name")
    }
}

const fn same(a: &[u8], b: &[u8]) -> bool {
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    i == a.len() && i == b.len()
}

impl std::fmt::Debug for MetricId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.id())
    }
}

impl Serialize for MetricId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.id())
    }
}

impl<'de> Deserialize<'de> for MetricId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let id = String::deserialize(deserializer)?;
        Self::from_id(&id).ok_or_else(|| serde::de::Error::unknown_variant(&id, &IDS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_unique_names_and_read_again() {
        let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        for (id, metric) in MetricId::all().zip(METRICS) {
            assert!(!metric.id.is_empty() && metric.id.bytes().all(plain), "{id:?}");
            assert_eq!(MetricId::from_id(metric.id), Some(id), "a name that two metrics have");
            let json = serde_json::to_string(&id).unwrap();
            assert_eq!(json, format!("\"{}\"", metric.id));
            assert_eq!(serde_json::from_str::<MetricId>(&json).unwrap(), id);
            assert!(metric.decimals <= 12 && metric.tolerance >= 0.0 && !metric.summary.is_empty(), "{id:?}");
        }
        assert_eq!(MetricId::all().count(), METRICS.len());
        assert_eq!([MetricId::PSNR, MetricId::SPLATS].map(MetricId::id), ["psnr", "splats"]);
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let error = serde_json::from_str::<MetricId>("\"beauty\"").unwrap_err().to_string();
        for id in IDS.iter().chain(&["beauty"]) {
            assert!(error.contains(&format!("`{id}`")), "{error}");
        }
    }
}
