//! What becomes of the allowed classes: plain values, arrays, and objects of which the state is kept.

use super::class::Class;
use super::input::Input;
use super::numpy;
use super::value::{ArrayNode, Bytes, Data, Dtype, Heap, Node, Storage, TensorPlace, Value};
use skinsplat_core::scene::SceneError;

fn broken(problem: impl Into<String>) -> SceneError {
    SceneError::new("pickle", problem, "an object as NumPy, SciPy, chumpy or joblib write it")
}

/// `class(*arguments)`.
pub(super) fn object(heap: &mut Heap, class: Class, arguments: &[Value]) -> Result<Value, SceneError> {
    let argument = |i: usize| arguments.get(i).copied().unwrap_or(Value::None);
    match class {
        Class::Reconstruct | Class::NdArray => heap.push(Node::Array(ArrayNode {
            dtype: Dtype { descr: None },
            shape: vec![0],
            fortran_order: false,
            data: Data::Unset,
        })),
        Class::Scalar => numpy::scalar(heap, argument(0), argument(1)),
        Class::FromBuffer => numpy::from_buffer(heap, arguments),
        Class::Dtype => {
            let descr = heap.text(argument(0)).filter(|name| name.len() <= 32);
            heap.push(Node::Dtype(Dtype { descr: descr.map(|name| format!("={name}").into()) }))
        }
        Class::Encode => encoded(heap, argument(0)),
        Class::Bytes => match arguments {
            [] => heap.push(Node::Bytes(Bytes::Owned([].into()))),
            [value, ..] if matches!(heap.get(*value), Some(Node::Bytes(_))) => Ok(*value),
            [..] => encoded(heap, argument(0)),
        },
        Class::List | Class::Tuple => match heap.items(argument(0)) {
            Some(_) => Ok(argument(0)),
            None => heap.push(Node::List(Vec::new())),
        },
        Class::Dict => dictionary(heap, argument(0)),
        Class::DefaultDict => heap.push(Node::Dict(Vec::new())),
        Class::Reconstructor => match heap.get(argument(0)) {
            Some(Node::Class(inner)) if inner.has_state() => {
                let class = *inner;
                heap.push(Node::Instance { class, state: Value::None })
            }
            _ => Err(broken("a base class of its own")),
        },
        Class::Csc | Class::Csr | Class::Coo | Class::Ch | Class::Select | Class::JoblibArray => {
            heap.push(Node::Instance { class, state: Value::None })
        }
        Class::Tensor => tensor(heap, arguments),
        Class::Parameter => Ok(argument(0)),
        Class::Object | Class::Plain | Class::Storage(_) => Err(broken("a call of a plain type")),
    }
}

/// The persistent id `("storage", type, key, device, elements)` of torch. Where it had been does not matter.
pub(super) fn storage(heap: &mut Heap, id: Value) -> Result<Value, SceneError> {
    let odd = || broken("a persistent id that is no storage of torch");
    let Some(&[tag, kind, key, _, elements, ..]) = heap.items(id) else { return Err(odd()) };
    let Some(Node::Class(Class::Storage(kind))) = heap.get(kind) else { return Err(odd()) };
    let (kind, key) = (*kind, heap.text(key));
    let elements = match elements {
        Value::Int(elements) => usize::try_from(elements).ok(),
        _ => None,
    };
    match (heap.is_text(tag, "storage"), key, elements) {
        (true, Some(key), Some(elements)) => {
            heap.charge(key.len())?;
            heap.push(Node::Storage(Storage { kind, key: key.into(), elements }))
        }
        _ => Err(odd()),
    }
}

/// `_rebuild_tensor_v2(storage, offset, shape, strides, …)`.
fn tensor(heap: &mut Heap, arguments: &[Value]) -> Result<Value, SceneError> {
    let odd = || broken("a tensor without its storage, offset, shape or strides");
    let &[storage, Value::Int(offset), shape, strides, ..] = arguments else { return Err(odd()) };
    let Some(Node::Storage(Storage { kind, key, elements })) = heap.get(storage) else { return Err(odd()) };
    let (storage, key, elements) = (*kind, key.clone(), *elements);
    let offset = usize::try_from(offset).ok().ok_or_else(odd)?;
    let (Some(shape), Some(strides)) = (heap.shape(shape), heap.shape(strides)) else { return Err(odd()) };
    if shape.len() != strides.len() {
        return Err(odd());
    }
    heap.charge(shape.len() + strides.len())?;
    heap.push(Node::Tensor(TensorPlace { storage, key, elements, offset, shape, strides }))
}

/// `OrderedDict([(key, value), …])`, or an empty dictionary.
fn dictionary(heap: &mut Heap, items: Value) -> Result<Value, SceneError> {
    let pairs: Vec<(Value, Value)> = match heap.get(items) {
        Some(Node::Dict(_)) => return Ok(items),
        Some(Node::List(items) | Node::Tuple(items)) => {
            let pair = |item: &Value| match heap.items(*item) {
                Some(&[key, value]) => Ok((key, value)),
                _ => Err(broken("a dictionary of something else than pairs")),
            };
            items.iter().map(pair).collect::<Result<_, _>>()?
        }
        _ => Vec::new(),
    };
    heap.charge(2 * pairs.len())?;
    heap.push(Node::Dict(pairs))
}

/// Bytes that Python 3 wrote as text, a character a byte.
fn encoded(heap: &mut Heap, text: Value) -> Result<Value, SceneError> {
    let Some(Node::Text(text)) = heap.get(text) else { return Err(broken("bytes that are no text")) };
    let length = text.chars().count();
    let bytes = text.chars().map(|c| u8::try_from(u32::from(c))).collect::<Result<Vec<u8>, _>>();
    let Ok(bytes) = bytes else { return Err(broken("bytes with characters beyond Latin-1")) };
    heap.charge(length)?;
    heap.push(Node::Bytes(Bytes::Owned(bytes.into())))
}

/// `object.__setstate__(state)`.
pub(super) fn set_state(heap: &mut Heap, object: Value, state: Value) -> Result<(), SceneError> {
    match heap.get(object) {
        Some(Node::Array(_)) => {
            let array = numpy::array_of_state(heap, state)?;
            if let Some(node) = heap.get_mut(object) {
                *node = Node::Array(array);
            }
        }
        Some(Node::Dtype(dtype)) => {
            let dtype = numpy::dtype_of_state(heap, dtype, state)?;
            if let Some(node) = heap.get_mut(object) {
                *node = Node::Dtype(dtype);
            }
        }
        Some(Node::Instance { .. }) => {
            let state = attributes(heap, state);
            if let Some(Node::Instance { state: own, .. }) = heap.get_mut(object) {
                *own = state;
            }
        }
        // Subclasses of dict and list may bring attributes, and tensors too; they are not read.
        Some(Node::Dict(_) | Node::List(_) | Node::Tensor(_)) => {}
        _ => return Err(broken(format!("a state for {}", heap.describe(object)))),
    }
    Ok(())
}

/// The dictionary of a state; objects with slots have a pair of them.
fn attributes(heap: &Heap, state: Value) -> Value {
    match heap.get(state) {
        Some(Node::Tuple(parts)) => {
            parts.iter().copied().find(|part| matches!(heap.get(*part), Some(Node::Dict(_)))).unwrap_or(state)
        }
        _ => state,
    }
}

/// joblib's arrays: their bytes follow the state, after padding where the state has an alignment.
pub(super) fn joblib_array(heap: &mut Heap, input: &mut Input, state: Value) -> Result<Value, SceneError> {
    let part = |name: &str| {
        heap.entry(state, name).ok_or_else(|| broken(format!("a joblib array without its {name}")))
    };
    let shape = heap.shape(part("shape")?).ok_or_else(|| broken("a joblib array with a broken shape"))?;
    let fortran_order = heap.is_text(part("order")?, "F");
    let Some(Node::Dtype(dtype)) = heap.get(part("dtype")?) else {
        return Err(broken("a joblib array without its type"));
    };
    let dtype = dtype.clone();
    if matches!(heap.entry(state, "numpy_array_alignment_bytes"), Some(Value::Int(_))) {
        let padding = input.byte(&heap.file)?;
        input.take(&heap.file, usize::from(padding))?;
    }
    let bytes = numpy::size(&dtype, &shape)?;
    let range = input.take(&heap.file, bytes)?;
    heap.push(Node::Array(ArrayNode { dtype, shape, fortran_order, data: Data::Raw(Bytes::Slice(range)) }))
}
