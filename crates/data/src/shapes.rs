//! Shapes of named arrays against patterns.

use super::Error;
use super::npy::Array;
use std::collections::BTreeMap;
use std::path::Path;

/// The extents that letters of patterns stand for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Extents(BTreeMap<char, usize>);

impl Extents {
    /// An array of finite values whose shape fits `pattern`, such as `"V,3"`. A letter stands for any extent when it is
    /// first met and for the same extent in every later array; `*` for any extent; nothing for a scalar.
    pub(crate) fn check(
        &mut self,
        path: &Path,
        name: &str,
        array: Array,
        pattern: &str,
    ) -> Result<Array, Error> {
        self.check_shape(path, name, &array.shape, pattern)?;
        if let Some(i) = array.values.iter().position(|v| !v.is_finite()) {
            let index = array.index_of(i);
            return Err(Error::invalid(path, format!("{name}{index:?}"), "NaN or infinite", "finite values"));
        }
        Ok(array)
    }

    /// As [`Extents::check`], of the shape alone.
    pub(crate) fn check_shape(
        &mut self,
        path: &Path,
        name: &str,
        shape: &[usize],
        pattern: &str,
    ) -> Result<(), Error> {
        let tokens: Vec<&str> = pattern.split(',').filter(|t| !t.is_empty()).collect();
        let mut fits = tokens.len() == shape.len();
        for (token, &extent) in tokens.iter().zip(shape) {
            let expected = match (token.parse::<usize>(), token.chars().next()) {
                (Ok(number), _) => number,
                (_, Some('*')) => extent,
                (_, Some(letter)) if fits => *self.0.entry(letter).or_insert(extent),
                _ => extent,
            };
            fits &= expected == extent;
        }
        if fits {
            return Ok(());
        }
        let known: Vec<String> = tokens
            .iter()
            .filter_map(|t| t.chars().next())
            .filter_map(|letter| Some(format!("{letter} = {}", self.0.get(&letter)?)))
            .collect();
        let known = if known.is_empty() { String::new() } else { format!(" with {}", known.join(", ")) };
        Err(Error::invalid(path, name, format!("shape {shape:?}"), format!("({pattern}){known}")))
    }
}

impl Array {
    /// The index of the value at flat position `i`.
    fn index_of(&self, i: usize) -> Vec<usize> {
        let mut rest = i;
        let mut index: Vec<usize> = self
            .shape
            .iter()
            .rev()
            .map(|&n| {
                let k = rest % n;
                rest /= n;
                k
            })
            .collect();
        index.reverse();
        index
    }
}
