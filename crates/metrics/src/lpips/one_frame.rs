//! LPIPS of the images of one frame.

use super::network::{Features, Network, network_input};
use super::{FeatureMap, LpipsNet, LpipsVariant, PerceptualDistance};
use crate::{MetricsError, Planes};
use std::sync::{Arc, Mutex, PoisonError};

/// Where networks come from; they are asked for only when a distance is.
pub trait NetworkSource: Sync {
    /// The network.
    ///
    /// # Errors
    /// [`MetricsError::NoWeights`] if it is not at hand.
    fn network(&self, net: LpipsNet) -> Result<&Network, MetricsError>;
}

/// Bytes of features that are kept; those of a 512 x 512 image take 13 MB (AlexNet) or 130 MB (VGG-16).
const KEPT: usize = 192 << 20;

/// The distances of several renders from one truth. Features of the images that were seen last are kept, so that those of
/// the truth are computed once; values do not depend on it.
pub struct OneFrame<'a> {
    source: &'a dyn NetworkSource,
    /// The most recently used last.
    seen: Mutex<Vec<Arc<Seen>>>,
}

/// An image, as a network saw it, and its features.
struct Seen {
    net: LpipsNet,
    input: FeatureMap,
    features: Features,
}

impl<'a> OneFrame<'a> {
    /// Nothing seen yet.
    pub fn new(source: &'a dyn NetworkSource) -> Self {
        Self { source, seen: Mutex::new(Vec::new()) }
    }

    fn seen(&self, network: &Network, input: FeatureMap) -> Arc<Seen> {
        // Not held while features are computed: a thread that waits for others may be given a task that comes here too.
        let list = || self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let found = |list: &mut Vec<Arc<Seen>>| {
            let at = list.iter().position(|seen| seen.net == network.net() && seen.input == input)?;
            let seen = list.remove(at);
            list.push(seen.clone());
            Some(seen)
        };
        if let Some(seen) = found(&mut list()) {
            return seen;
        }
        let features = network.features(&input);
        let seen = Arc::new(Seen { net: network.net(), input, features });
        let mut list = list();
        list.push(seen.clone());
        while list.iter().map(|seen| seen.bytes()).sum::<usize>() > KEPT {
            list.remove(0);
        }
        seen
    }
}

impl Seen {
    fn bytes(&self) -> usize {
        let maps = self.features.taps.iter().chain([&self.input]);
        maps.map(|map| size_of_val(map.values.as_slice())).sum()
    }
}

impl PerceptualDistance for OneFrame<'_> {
    fn distance(&self, render: &Planes, truth: &Planes, variant: LpipsVariant) -> Result<f64, MetricsError> {
        let (width, height) = (render.width(), render.height());
        MetricsError::check_size("truth", (truth.width(), truth.height()), (width, height))?;
        let minimum = variant.net.minimum_size();
        if width.min(height) < minimum {
            return Err(MetricsError::TooSmall { metric: variant.metric(), width, height, minimum });
        }
        let network = self.source.network(variant.net)?;
        let [render, truth] =
            [render, truth].map(|image| self.seen(network, network_input(image, variant.range)));
        Ok(network.layer_distances(&render.features, &truth.features).iter().sum())
    }
}
