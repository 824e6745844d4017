//! What a pickle holds: nodes in one list, values that point into it. Nothing owns anything, so neither depth nor cycles
//! cost a recursion.

use super::class::Class;
use skinsplat_core::scene::SceneError;
use std::ops::Range;
use std::sync::Arc;

/// NumPy's own limit.
const MAX_AXES: usize = 64;

/// A number, or the place of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Node(u32),
}

/// Everything that is no number.
#[derive(Debug)]
pub(super) enum Node {
    /// Lists and sets.
    List(Vec<Value>),
    Tuple(Vec<Value>),
    /// Pairs in the order in which they came; of equal keys the last one counts.
    Dict(Vec<(Value, Value)>),
    Bytes(Bytes),
    Text(String),
    Class(Class),
    Dtype(Dtype),
    Array(ArrayNode),
    /// An object of an allowed class, with the state that `__setstate__` would have got.
    Instance {
        class: Class,
        state: Value,
    },
    /// Where numbers of torch lie: an entry of the archive around the pickle.
    Storage(Storage),
    Tensor(TensorPlace),
    /// Something that is carried along and has no value here, in words.
    Other(&'static str),
}

/// A storage of torch.
#[derive(Clone, Debug)]
pub(super) struct Storage {
    /// The name of its type.
    pub(super) kind: &'static str,
    /// The name of its entry.
    pub(super) key: Arc<str>,
    /// How many numbers it holds, says the pickle.
    pub(super) elements: usize,
}

/// Where a tensor lies in a storage. Nothing has been checked against the storage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TensorPlace {
    /// The name of the storage's type (`FloatStorage`).
    pub(crate) storage: &'static str,
    /// The name of the storage's entry in the archive.
    pub(crate) key: Arc<str>,
    /// Elements of the storage.
    pub(crate) elements: usize,
    /// The first element.
    pub(crate) offset: usize,
    /// Extent of each axis.
    pub(crate) shape: Vec<usize>,
    /// Elements from one index of an axis to the next.
    pub(crate) strides: Vec<usize>,
}

/// Bytes of the file, or such as an opcode has unescaped. Copies share them.
#[derive(Clone, Debug)]
pub(super) enum Bytes {
    Slice(Range<usize>),
    Owned(Arc<[u8]>),
}

/// A NumPy element type: `<f8`; none for records and sub-arrays.
#[derive(Clone, Debug)]
pub(super) struct Dtype {
    pub(super) descr: Option<Arc<str>>,
}

/// A NumPy array or scalar as it is stored.
#[derive(Clone, Debug)]
pub(super) struct ArrayNode {
    pub(super) dtype: Dtype,
    pub(super) shape: Vec<usize>,
    pub(super) fortran_order: bool,
    pub(super) data: Data,
}

/// The elements of an array.
#[derive(Clone, Debug)]
pub(super) enum Data {
    /// `_reconstruct` has been called, the state has not come yet.
    Unset,
    Raw(Bytes),
    /// A list of Python objects, in memory order.
    Objects(Value),
}

/// All nodes of a file, and the bytes that they point into.
#[derive(Debug)]
pub(super) struct Heap {
    pub(super) file: Vec<u8>,
    nodes: Vec<Node>,
    /// Bytes that nodes own. What a file can make a reader copy is bounded by its length.
    owned: usize,
}

impl Heap {
    pub(super) fn new(file: Vec<u8>) -> Self {
        Self { file, nodes: Vec::new(), owned: 0 }
    }

    pub(super) fn push(&mut self, node: Node) -> Result<Value, SceneError> {
        let Ok(place) = u32::try_from(self.nodes.len()) else {
            return Err(SceneError::new("pickle", "more than 2^32 objects", "fewer"));
        };
        self.nodes.push(node);
        Ok(Value::Node(place))
    }

    /// Makes room in the account for a copy of `count` bytes or values.
    pub(super) fn charge(&mut self, count: usize) -> Result<(), SceneError> {
        self.owned = self.owned.saturating_add(count);
        if self.owned > 8 * self.file.len() + 4096 {
            let problem = format!("it copies its {} bytes over and over", self.file.len());
            return Err(SceneError::new("pickle", problem, "objects that are as large as the file"));
        }
        Ok(())
    }

    pub(super) fn get(&self, value: Value) -> Option<&Node> {
        match value {
            Value::Node(place) => self.nodes.get(place as usize),
            _ => None,
        }
    }

    pub(super) fn get_mut(&mut self, value: Value) -> Option<&mut Node> {
        match value {
            Value::Node(place) => self.nodes.get_mut(place as usize),
            _ => None,
        }
    }

    pub(super) fn bytes<'a>(&'a self, bytes: &'a Bytes) -> &'a [u8] {
        match bytes {
            Bytes::Slice(range) => self.file.get(range.clone()).unwrap_or_default(),
            Bytes::Owned(bytes) => bytes,
        }
    }

    /// Text, or the bytes that Python 2 calls a string.
    pub(super) fn text(&self, value: Value) -> Option<String> {
        match self.get(value)? {
            Node::Text(text) => Some(text.clone()),
            Node::Bytes(bytes) => Some(decoded(self.bytes(bytes))),
            _ => None,
        }
    }

    /// True if a value is this text.
    pub(super) fn is_text(&self, value: Value, text: &str) -> bool {
        match self.get(value) {
            Some(Node::Text(own)) => own == text,
            Some(Node::Bytes(bytes)) => self.bytes(bytes) == text.as_bytes(),
            _ => false,
        }
    }

    /// The items of a list or tuple.
    pub(super) fn items(&self, value: Value) -> Option<&[Value]> {
        match self.get(value)? {
            Node::List(items) | Node::Tuple(items) => Some(items),
            _ => None,
        }
    }

    /// The entry of a dictionary; `"1"` also stands for the number.
    pub(super) fn entry(&self, dict: Value, key: &str) -> Option<Value> {
        let Some(Node::Dict(pairs)) = self.get(dict) else { return None };
        let number = key.parse().ok().map(Value::Int);
        let fits = |own: Value| Some(own) == number || self.is_text(own, key);
        pairs.iter().rev().find(|(own, _)| fits(*own)).map(|(_, value)| *value)
    }

    /// A tuple of extents.
    pub(super) fn shape(&self, value: Value) -> Option<Vec<usize>> {
        let extent = |value: &Value| match value {
            Value::Int(n) => usize::try_from(*n).ok(),
            _ => self.scalar(*value).filter(|v| *v >= 0.0 && v.fract() == 0.0).map(|v| v as usize),
        };
        match value {
            Value::Int(_) => Some(vec![extent(&value)?]),
            _ => self.items(value).filter(|items| items.len() <= MAX_AXES)?.iter().map(extent).collect(),
        }
    }

    /// A number, of Python or of NumPy.
    pub(super) fn scalar(&self, value: Value) -> Option<f64> {
        match value {
            Value::Bool(b) => Some(f64::from(u8::from(b))),
            Value::Int(n) => Some(n as f64),
            Value::Float(x) => Some(x),
            Value::None => None,
            Value::Node(_) => match self.get(value)? {
                Node::Array(array) if array.shape.is_empty() => {
                    super::numpy::decode(self, array, "number").ok()?.values.first().copied()
                }
                _ => None,
            },
        }
    }

    /// What a value is, in words.
    pub(super) fn describe(&self, value: Value) -> String {
        let Some(node) = self.get(value) else {
            return match value {
                Value::None => "None".to_owned(),
                Value::Bool(b) => format!("{b}"),
                Value::Int(n) => format!("{n}"),
                Value::Float(x) => format!("{x}"),
                Value::Node(_) => "nothing".to_owned(),
            };
        };
        match node {
            Node::List(items) => format!("a list of {}", items.len()),
            Node::Tuple(items) => format!("a tuple of {}", items.len()),
            Node::Dict(pairs) => format!("a dictionary of {}", pairs.len()),
            Node::Bytes(_) | Node::Text(_) => "a string".to_owned(),
            Node::Class(class) | Node::Instance { class, .. } => class.title().to_owned(),
            Node::Dtype(_) => "a NumPy type".to_owned(),
            Node::Array(array) => format!("a NumPy array of shape {:?}", array.shape),
            Node::Storage(_) => "a storage of torch".to_owned(),
            Node::Tensor(tensor) => format!("a tensor of shape {:?}", tensor.shape),
            Node::Other(what) => (*what).to_owned(),
        }
    }
}

/// UTF-8, or Latin-1 where it is not.
pub(super) fn decoded(bytes: &[u8]) -> String {
    std::str::from_utf8(bytes)
        .map_or_else(|_| bytes.iter().map(|&byte| char::from(byte)).collect(), str::to_owned)
}
