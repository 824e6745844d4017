//! Values by name.

use super::class::Class;
use super::sparse::{self, Rows};
use super::value::{Data, Node, TensorPlace, Value};
use super::{Array, Error, Pickle, numpy};
use crate::shapes::Extents;

/// How deep lists of lists of numbers are followed.
const MAX_DEPTH: usize = 16;

/// A value of a pickle and where it stands in it. Asking for what it is not is an error that names file and place.
#[derive(Clone, Debug)]
pub struct Field<'a> {
    pickle: &'a Pickle,
    name: String,
    value: Value,
}

impl<'a> Field<'a> {
    pub(super) fn new(pickle: &'a Pickle, name: String, value: Value) -> Self {
        let mut value = value;
        // numpy.save wraps a dictionary into an array without axes.
        if let Some(Node::Array(array)) = pickle.heap.get(value)
            && let (true, Data::Objects(items)) = (array.shape.is_empty(), &array.data)
            && let Some(&[only]) = pickle.heap.items(*items)
        {
            value = only;
        }
        Self { pickle, name, value }
    }

    /// Where it stands: `pose[3]`; empty for the whole file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// An error about this value.
    pub fn invalid(&self, problem: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::invalid(&self.pickle.path, self.label(), problem, expected)
    }

    /// What errors call it.
    fn label(&self) -> &str {
        if self.name.is_empty() { "pickle" } else { &self.name }
    }

    /// What it is, in words.
    pub fn describe(&self) -> String {
        self.pickle.heap.describe(self.value)
    }

    fn is_not(&self, expected: &str) -> Error {
        self.invalid(self.pickle.heap.describe(self.value), expected)
    }

    /// The keys of a dictionary, in the order of the file; numbers as text.
    ///
    /// # Errors
    /// If it is none.
    pub fn keys(&self) -> Result<Vec<String>, Error> {
        let heap = &self.pickle.heap;
        let Some(Node::Dict(pairs)) = heap.get(self.value) else { return Err(self.is_not("a dictionary")) };
        let key = |value: Value| heap.text(value).unwrap_or_else(|| heap.describe(value));
        let mut keys: Vec<String> = Vec::new();
        let mut seen = std::collections::BTreeSet::new();
        for (own, _) in pairs {
            let name = key(*own);
            if seen.insert(name.clone()) {
                keys.push(name);
            }
        }
        Ok(keys)
    }

    /// True for a dictionary with this key.
    pub fn contains(&self, key: &str) -> bool {
        self.pickle.heap.entry(self.value, key).is_some_and(|value| value != Value::None)
    }

    /// An entry of a dictionary; a number as key is written as text.
    ///
    /// # Errors
    /// If it is no dictionary, or has no such entry. `None` counts as none.
    pub fn get(&self, key: &str) -> Result<Self, Error> {
        if let Some(entry) = self.optional(key)? {
            return Ok(entry);
        }
        let keys: Vec<String> = self.keys()?.iter().map(|name| name.escape_debug().to_string()).collect();
        let place = Self::new(self.pickle, self.below(key), Value::None);
        Err(place.invalid(format!("missing; there are {}", keys.join(", ")), "an entry of this name"))
    }

    /// As [`Field::get`]; nothing if there is no such entry, or it is `None`.
    ///
    /// # Errors
    /// If it is no dictionary.
    pub fn optional(&self, key: &str) -> Result<Option<Self>, Error> {
        let heap = &self.pickle.heap;
        if !matches!(heap.get(self.value), Some(Node::Dict(_))) {
            return Err(self.is_not("a dictionary"));
        }
        let entry = heap.entry(self.value, key).filter(|value| *value != Value::None);
        Ok(entry.map(|value| Self::new(self.pickle, self.below(key), value)))
    }

    fn below(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }

    /// The items of a list or tuple, or of an array of Python objects with one axis.
    ///
    /// # Errors
    /// If it is none.
    pub fn items(&self) -> Result<Vec<Self>, Error> {
        let items = self.item_values().ok_or_else(|| self.is_not("a list"))?;
        let item =
            |(i, value): (usize, &Value)| Self::new(self.pickle, format!("{}[{i}]", self.name), *value);
        Ok(items.iter().enumerate().map(item).collect())
    }

    fn item_values(&self) -> Option<&'a [Value]> {
        let heap = &self.pickle.heap;
        match heap.get(self.value)? {
            Node::Array(array) => match (&array.data, array.shape.len()) {
                (Data::Objects(items), 1) => heap.items(*items),
                _ => None,
            },
            _ => heap.items(self.value),
        }
    }

    /// What a dictionary, list or tuple holds; nothing of anything else.
    pub(crate) fn parts(&self) -> Vec<Self> {
        let heap = &self.pickle.heap;
        match heap.get(self.value) {
            Some(Node::Dict(pairs)) => {
                let key = |key: Value| heap.text(key).unwrap_or_else(|| heap.describe(key));
                let part =
                    |&(own, value): &(Value, Value)| Self::new(self.pickle, self.below(&key(own)), value);
                pairs.iter().map(part).collect()
            }
            Some(Node::List(_) | Node::Tuple(_)) => self.items().unwrap_or_default(),
            _ => Vec::new(),
        }
    }

    /// Where a tensor of torch lies, if it is one.
    pub(crate) fn tensor(&self) -> Option<TensorPlace> {
        match self.pickle.heap.get(self.value)? {
            Node::Tensor(place) => Some(place.clone()),
            _ => None,
        }
    }

    /// A text, of either Python's strings.
    ///
    /// # Errors
    /// If it is none.
    pub fn text(&self) -> Result<String, Error> {
        let heap = &self.pickle.heap;
        if let Some(text) = heap.text(self.value) {
            return Ok(text);
        }
        match heap.get(self.value) {
            Some(Node::Array(array)) => numpy::decode_text(heap, array, self.label())
                .and_then(|texts| (texts.len() == 1).then(|| texts.concat()))
                .ok_or_else(|| self.is_not("a text")),
            _ => Err(self.is_not("a text")),
        }
    }

    /// Several texts: a list of them, or an array.
    ///
    /// # Errors
    /// If it is something else.
    pub fn texts(&self) -> Result<Vec<String>, Error> {
        let heap = &self.pickle.heap;
        if let Some(Node::Array(array)) = heap.get(self.value)
            && let Some(texts) = numpy::decode_text(heap, array, self.label())
        {
            return Ok(texts);
        }
        self.items()?.iter().map(Self::text).collect()
    }

    /// A finite number.
    ///
    /// # Errors
    /// If it is none.
    pub fn number(&self) -> Result<f64, Error> {
        let array = self.array()?;
        match array.values[..] {
            [value] if value.is_finite() => Ok(value),
            _ => Err(self.is_not("a finite number")),
        }
    }

    /// A whole number, at least 0.
    ///
    /// # Errors
    /// If it is none.
    pub fn count(&self) -> Result<usize, Error> {
        let value = self.number()?;
        let fits = value >= 0.0 && value.fract() == 0.0 && value < 9e15;
        if fits {
            Ok(value as usize)
        } else {
            Err(self.invalid(format!("{value}"), "a whole number, at least 0"))
        }
    }

    /// Numbers: an array, a matrix of `scipy.sparse` (made dense), a constant of chumpy, a number, or lists of such of
    /// equal shape.
    ///
    /// # Errors
    /// If it is something else, of other numbers than reals, or truncated.
    pub fn array(&self) -> Result<Array, Error> {
        // Lists may repeat one another: what they expand to is bounded by what the file holds.
        let mut budget = self.pickle.heap.file.len();
        self.array_within(&mut budget, MAX_DEPTH)
    }

    /// As [`Field::array`], of finite values and a shape that fits a pattern such as `"T,3"` (as [`Archive::require`] has
    /// them, each letter free).
    ///
    /// [`Archive::require`]: crate::npz::Archive::require
    ///
    /// # Errors
    /// As [`Field::array`]; another shape, NaN or infinite values.
    pub fn numbers(&self, pattern: &str) -> Result<Array, Error> {
        Extents::default().check(&self.pickle.path, self.label(), self.array()?, pattern)
    }

    /// A matrix by its rows; dense ones lose their zeros.
    ///
    /// # Errors
    /// If it is none, or its indices lie outside it.
    pub fn rows(&self) -> Result<Rows, Error> {
        match self.pickle.heap.get(self.value) {
            Some(Node::Instance { class: Class::Csc | Class::Csr | Class::Coo, .. }) => self.sparse_rows(),
            _ => Rows::dense(&self.array()?).ok_or_else(|| self.is_not("a matrix")),
        }
    }

    fn sparse_rows(&self) -> Result<Rows, Error> {
        let Some(&Node::Instance { class, state }) = self.pickle.heap.get(self.value) else {
            return Err(self.is_not("a sparse matrix"));
        };
        sparse::rows(&Self::new(self.pickle, self.name.clone(), state), class)
    }

    fn array_within(&self, budget: &mut usize, depth: usize) -> Result<Array, Error> {
        let heap = &self.pickle.heap;
        if let Some(number) = heap.scalar(self.value) {
            return Ok(Array { shape: Vec::new(), values: vec![number] });
        }
        let too_large =
            || self.invalid("more values than the file has bytes", "lists that hold what they show");
        let node = heap.get(self.value).ok_or_else(|| self.is_not("an array of numbers"))?;
        let array = match node {
            Node::Array(array) if matches!(array.data, Data::Objects(_)) => self.stacked(budget, depth)?,
            Node::Array(array) => {
                numpy::decode(heap, array, self.label()).map_err(|e| Error::scene(&self.pickle.path, e))?
            }
            Node::List(_) | Node::Tuple(_) => return self.stacked(budget, depth),
            Node::Instance { class: Class::Ch, state } => return self.inner(*state, "x", budget, depth),
            Node::Instance { class: Class::Select, state } => self.selected(*state, budget, depth)?,
            Node::Instance { class: Class::Csc | Class::Csr | Class::Coo, .. } => {
                let rows = self.sparse_rows()?;
                rows.to_dense(*budget).ok_or_else(too_large)?
            }
            _ => return Err(self.is_not("an array of numbers")),
        };
        *budget = budget.checked_sub(array.values.len()).ok_or_else(too_large)?;
        Ok(array)
    }

    /// Part of the state of an object.
    fn inner(&self, state: Value, key: &str, budget: &mut usize, depth: usize) -> Result<Array, Error> {
        let depth =
            depth.checked_sub(1).ok_or_else(|| self.invalid("objects nested too deep", "fewer levels"))?;
        Self::new(self.pickle, self.name.clone(), state).get(key)?.array_within(budget, depth)
    }

    /// Items of equal shape as one array.
    fn stacked(&self, budget: &mut usize, depth: usize) -> Result<Array, Error> {
        let depth =
            depth.checked_sub(1).ok_or_else(|| self.invalid("lists nested too deep", "fewer levels"))?;
        let items = self.items()?;
        let mut values = Vec::new();
        let mut shape: Option<Vec<usize>> = None;
        for item in &items {
            *budget = budget.checked_sub(1).ok_or_else(|| {
                self.invalid("more values than the file has bytes", "lists that hold what they show")
            })?;
            let own = item.array_within(budget, depth)?;
            if *shape.get_or_insert_with(|| own.shape.clone()) != own.shape {
                return Err(item.invalid(
                    format!("shape {:?}", own.shape),
                    format!("{:?}, as the first", shape.unwrap_or_default()),
                ));
            }
            values.extend(own.values);
        }
        let mut stacked = vec![items.len()];
        stacked.extend(shape.unwrap_or_default());
        Ok(Array { shape: stacked, values })
    }

    /// `a.ravel()[idxs].reshape(preferred_shape)`, which is all that a slice of a constant of chumpy is.
    fn selected(&self, state: Value, budget: &mut usize, depth: usize) -> Result<Array, Error> {
        let from = self.inner(state, "a", budget, depth)?;
        let indices = self.inner(state, "idxs", budget, depth)?;
        let element = |index: &f64| {
            let place = if *index < 0.0 { index + from.values.len() as f64 } else { *index };
            from.values.get(place as usize).copied().filter(|_| place >= 0.0)
        };
        let values: Option<Vec<f64>> = indices.values.iter().map(element).collect();
        let values = values
            .ok_or_else(|| self.invalid("an index outside of what is selected from", "indices within it"))?;
        let state = Self::new(self.pickle, self.name.clone(), state);
        let shape = match state.optional("preferred_shape")? {
            Some(shape) => self.pickle.heap.shape(shape.value),
            None => Some(vec![values.len()]),
        };
        let fits = |shape: &Vec<usize>| {
            shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n)) == Some(values.len())
        };
        match shape.filter(fits) {
            Some(shape) => Ok(Array { shape, values }),
            None => {
                Err(self.invalid("a selection whose shape does not fit its size", "chumpy's preferred_shape"))
            }
        }
    }
}
