//! The classes and functions that a pickle may name. Everything else is refused by name: a name is all that is looked at,
//! nothing is imported or called.

use skinsplat_core::scene::SceneError;

/// What stands for an allowed class or function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// `numpy._core.multiarray._reconstruct`: an array without its state.
    Reconstruct,
    /// `numpy._core.multiarray.scalar`.
    Scalar,
    /// `numpy._core.numeric._frombuffer`: arrays of protocol 5.
    FromBuffer,
    NdArray,
    Dtype,
    /// `_codecs.encode`: how Python 3 writes bytes in protocols 0 to 2.
    Encode,
    /// `copyreg._reconstructor`: objects of protocols 0 and 1.
    Reconstructor,
    Object,
    List,
    Tuple,
    Dict,
    DefaultDict,
    Bytes,
    /// A number type or `str`: named, never called.
    Plain,
    Csc,
    Csr,
    Coo,
    /// `chumpy.ch.Ch`: a constant, its value in `x`.
    Ch,
    /// `chumpy.reordering.Select`: elements of another one.
    Select,
    /// `joblib.numpy_pickle.NumpyArrayWrapper`: an array whose bytes follow.
    JoblibArray,
    /// A storage type of torch, by its name.
    Storage(&'static str),
    /// `torch._utils._rebuild_tensor_v2`: a tensor that lies in a storage.
    Tensor,
    /// `torch._utils._rebuild_parameter`: the tensor that it is given.
    Parameter,
}

/// Module without its leading underscores and versions, name, and what it is.
const ALLOWED: &[(&[&str], &[&str], Class)] = &[
    (&["numpy.core.multiarray", "numpy._core.multiarray"], &["_reconstruct"], Class::Reconstruct),
    (&["numpy.core.multiarray", "numpy._core.multiarray"], &["scalar"], Class::Scalar),
    (&["numpy.core.numeric", "numpy._core.numeric"], &["_frombuffer"], Class::FromBuffer),
    (&["numpy"], &["ndarray"], Class::NdArray),
    (&["numpy.matrixlib.defmatrix", "numpy.core.defmatrix", "numpy"], &["matrix"], Class::NdArray),
    (&["numpy"], &["dtype"], Class::Dtype),
    (
        &["numpy"],
        &[
            "bool_", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float16",
            "float32", "float64", "str_", "bytes_", "object_",
        ],
        Class::Plain,
    ),
    (&["_codecs"], &["encode"], Class::Encode),
    (&["copy_reg", "copyreg"], &["_reconstructor"], Class::Reconstructor),
    (&["__builtin__", "builtins"], &["object"], Class::Object),
    (&["__builtin__", "builtins"], &["list", "set", "frozenset"], Class::List),
    (&["__builtin__", "builtins"], &["tuple"], Class::Tuple),
    (&["__builtin__", "builtins"], &["dict"], Class::Dict),
    (&["__builtin__", "builtins"], &["bytes", "bytearray"], Class::Bytes),
    (&["__builtin__", "builtins"], &["bool", "int", "long", "float", "str", "unicode"], Class::Plain),
    (&["collections"], &["OrderedDict"], Class::Dict),
    (&["collections"], &["defaultdict"], Class::DefaultDict),
    (&["scipy.sparse.csc", "scipy.sparse._csc"], &["csc_matrix", "csc_array"], Class::Csc),
    (&["scipy.sparse.csr", "scipy.sparse._csr"], &["csr_matrix", "csr_array"], Class::Csr),
    (&["scipy.sparse.coo", "scipy.sparse._coo"], &["coo_matrix", "coo_array"], Class::Coo),
    (&["chumpy.ch", "chumpy"], &["Ch"], Class::Ch),
    (&["chumpy.reordering"], &["Select"], Class::Select),
    (&["joblib.numpy_pickle"], &["NumpyArrayWrapper"], Class::JoblibArray),
];

/// What torch's files name besides; their tensors lie outside of the pickle, so other files may not.
const OF_TORCH: &[(&[&str], &[&str], Class)] = &[
    (&["torch._utils"], &["_rebuild_tensor", "_rebuild_tensor_v2"], Class::Tensor),
    (&["torch._utils"], &["_rebuild_parameter", "_rebuild_parameter_with_state"], Class::Parameter),
    (&["torch"], &["Size"], Class::Tuple),
    (&["torch"], &["device"], Class::Tuple),
    (
        &["torch"],
        &["float64", "float32", "float16", "bfloat16", "int64", "int32", "int16", "int8", "uint8", "bool"],
        Class::Plain,
    ),
];

/// Names of torch's storages, in `torch` and `torch.storage`.
const STORAGES: &[&str] = &[
    "DoubleStorage",
    "FloatStorage",
    "HalfStorage",
    "BFloat16Storage",
    "LongStorage",
    "IntStorage",
    "ShortStorage",
    "CharStorage",
    "ByteStorage",
    "BoolStorage",
    "UntypedStorage",
];

impl Class {
    /// The class of this name in a file of torch.
    pub(super) fn named_by_torch(module: &str, name: &str) -> Result<Self, SceneError> {
        if let Some(storage) =
            STORAGES.iter().find(|storage| **storage == name && module.starts_with("torch"))
        {
            return Ok(Self::Storage(storage));
        }
        let found =
            OF_TORCH.iter().find(|(modules, names, _)| modules.contains(&module) && names.contains(&name));
        found.map_or_else(|| Self::named(module, name), |(.., class)| Ok(*class))
    }

    /// The class of this name.
    pub(super) fn named(module: &str, name: &str) -> Result<Self, SceneError> {
        let fits = |(modules, names, _): &&(&[&str], &[&str], Self)| {
            modules.contains(&module) && names.contains(&name)
        };
        ALLOWED.iter().find(fits).map(|(.., class)| *class).ok_or_else(|| {
            let shown: String = format!("{module}.{name}").chars().take(120).collect();
            let problem = format!(
                "an object of {}, which is not read (and nothing of it is run)",
                shown.escape_debug()
            );
            SceneError::new(
                "pickle",
                problem,
                "NumPy arrays, SciPy sparse matrices, chumpy constants and plain Python values",
            )
        })
    }

    /// What messages call an object of it.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Csc => "a SciPy csc_matrix",
            Self::Csr => "a SciPy csr_matrix",
            Self::Coo => "a SciPy coo_matrix",
            Self::Ch => "a chumpy.ch.Ch",
            Self::Select => "a chumpy.reordering.Select",
            Self::JoblibArray => "a joblib array",
            _ => "the name of a class",
        }
    }

    /// True for classes of which objects are kept, with their state.
    pub(super) fn has_state(self) -> bool {
        matches!(self, Self::Csc | Self::Csr | Self::Coo | Self::Ch | Self::Select | Self::JoblibArray)
    }
}
