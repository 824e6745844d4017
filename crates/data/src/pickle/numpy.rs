//! NumPy arrays, scalars and element types as pickles hold them.

use super::value::{ArrayNode, Data, Dtype, Heap, Node, Value};
use crate::npy::{self, Array};
use skinsplat_core::scene::SceneError;

fn broken(problem: impl Into<String>) -> SceneError {
    SceneError::new("pickle", problem, "a NumPy array or type as NumPy writes it")
}

/// The element type of a state `(version, byte order, sub-array, names, fields, size, …)`.
pub(super) fn dtype_of_state(heap: &Heap, dtype: &Dtype, state: Value) -> Result<Dtype, SceneError> {
    let items = heap
        .items(state)
        .filter(|items| items.len() >= 5)
        .ok_or_else(|| broken("a type without its state"))?;
    let order = heap.text(items[1]).ok_or_else(|| broken("a type without its byte order"))?;
    let plain = items[2] == Value::None && items[4] == Value::None;
    let name = dtype.descr.as_deref().and_then(|descr| descr.get(1..)).filter(|_| plain);
    let order = order.chars().next().unwrap_or('=');
    Ok(Dtype { descr: name.map(|name| format!("{order}{name}").into()) })
}

fn dtype_at(heap: &Heap, value: Value) -> Result<Dtype, SceneError> {
    match heap.get(value) {
        Some(Node::Dtype(dtype)) => Ok(dtype.clone()),
        _ => Err(broken(format!("{} as the type of an array", heap.describe(value)))),
    }
}

/// The array of a state `(version, shape, type, Fortran order, bytes)`, without the version in the oldest files.
pub(super) fn array_of_state(heap: &Heap, state: Value) -> Result<ArrayNode, SceneError> {
    let items = heap.items(state).ok_or_else(|| broken("an array without its state"))?;
    let [shape, dtype, order, data] = match *items {
        [_, shape, dtype, order, data] | [shape, dtype, order, data] => [shape, dtype, order, data],
        _ => return Err(broken(format!("a state of {} parts", items.len()))),
    };
    let shape = heap.shape(shape).ok_or_else(|| broken("an array with a broken shape"))?;
    let fortran_order = matches!(order, Value::Bool(true)) || matches!(order, Value::Int(n) if n != 0);
    let data = match heap.get(data) {
        Some(Node::Bytes(bytes)) => Data::Raw(bytes.clone()),
        Some(Node::List(_)) => Data::Objects(data),
        _ => return Err(broken(format!("{} as the elements of an array", heap.describe(data)))),
    };
    Ok(ArrayNode { dtype: dtype_at(heap, dtype)?, shape, fortran_order, data })
}

/// `scalar(type, bytes)`.
pub(super) fn scalar(heap: &mut Heap, dtype: Value, bytes: Value) -> Result<Value, SceneError> {
    let dtype = dtype_at(heap, dtype)?;
    let Some(Node::Bytes(bytes)) = heap.get(bytes) else { return Err(broken("a number without its bytes")) };
    let data = Data::Raw(bytes.clone());
    heap.push(Node::Array(ArrayNode { dtype, shape: Vec::new(), fortran_order: false, data }))
}

/// `_frombuffer(bytes, type, shape, order, axes)`.
pub(super) fn from_buffer(heap: &mut Heap, arguments: &[Value]) -> Result<Value, SceneError> {
    let &[bytes, dtype, shape, order, ref axes @ ..] = arguments else {
        return Err(broken("an array without its arguments"));
    };
    let Some(Node::Bytes(bytes)) = heap.get(bytes) else { return Err(broken("an array without its bytes")) };
    let bytes = bytes.clone();
    if axes.iter().any(|axis| *axis != Value::None) {
        return Err(broken("an array with axes in an order of its own"));
    }
    let shape = heap.shape(shape).ok_or_else(|| broken("an array with a broken shape"))?;
    let (dtype, fortran_order) = (dtype_at(heap, dtype)?, heap.is_text(order, "F"));
    heap.push(Node::Array(ArrayNode { dtype, shape, fortran_order, data: Data::Raw(bytes) }))
}

/// Bytes that an array takes.
pub(super) fn size(dtype: &Dtype, shape: &[usize]) -> Result<usize, SceneError> {
    let descr = descr(dtype)?;
    let width = descr.get(2..).and_then(|digits| digits.parse::<usize>().ok());
    let width =
        width.filter(|_| !descr.contains('O')).ok_or_else(|| broken(format!("elements of type {descr}")))?;
    let width = if descr[1..].starts_with('U') { width.saturating_mul(4) } else { width };
    let count = shape.iter().try_fold(width, |product, &n| product.checked_mul(n));
    count.ok_or_else(|| broken(format!("shape {shape:?}")))
}

fn descr(dtype: &Dtype) -> Result<&str, SceneError> {
    dtype.descr.as_deref().ok_or_else(|| broken("records as elements"))
}

/// The numbers of an array of numbers.
pub(super) fn decode(heap: &Heap, array: &ArrayNode, field: &str) -> Result<Array, SceneError> {
    let Data::Raw(bytes) = &array.data else {
        return Err(SceneError::new(field, "an array of Python objects", "an array of numbers"));
    };
    let dtype = descr(&array.dtype).map_err(|e| SceneError { field: field.to_owned(), ..e })?;
    npy::from_bytes(dtype, &array.shape, array.fortran_order, heap.bytes(bytes), field)
}

/// The strings of an array of strings.
pub(super) fn decode_text(heap: &Heap, array: &ArrayNode, field: &str) -> Option<Vec<String>> {
    let Data::Raw(bytes) = &array.data else { return None };
    let dtype = array.dtype.descr.as_deref()?;
    npy::text_from_bytes(dtype, &array.shape, heap.bytes(bytes), field).ok()
}
