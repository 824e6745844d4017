//! What a file of named arrays holds, for people: every array with its shape and how far its numbers reach, also those in
//! dictionaries of a pickle.

use super::Error;
use super::arrays::Arrays;
use super::pickle::Field;

/// How deep dictionaries are followed.
const DEPTH: usize = 3;

/// Something in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its name, with those of the dictionaries around it: `1.pose`.
    pub name: String,
    /// Type and shape, in words.
    pub what: String,
    /// How far its numbers reach; none if it holds none.
    pub reach: Option<Reach>,
}

/// The least and the greatest of some numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// The least that is finite.
    pub least: f64,
    /// The greatest that is finite.
    pub greatest: f64,
    /// How many are NaN or infinite.
    pub odd: usize,
}

impl Reach {
    /// Of some numbers; none if there is none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut found: Option<Self> = None;
        for value in values {
            let Self { least, greatest, odd } =
                found.unwrap_or(Self { least: f64::INFINITY, greatest: f64::NEG_INFINITY, odd: 0 });
            found = Some(match value.is_finite() {
                true => Self { least: least.min(value), greatest: greatest.max(value), odd },
                false => Self { least, greatest, odd: odd + 1 },
            });
        }
        found
    }
}

impl std::fmt::Display for Reach {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { least, greatest, odd } = self;
        match (least <= greatest, odd) {
            (true, 0) => write!(f, "{least:.4} to {greatest:.4}"),
            (true, odd) => write!(f, "{least:.4} to {greatest:.4}, {odd} NaN or infinite"),
            (false, odd) => write!(f, "{odd} NaN or infinite"),
        }
    }
}

/// Everything in a file, in its order.
///
/// # Errors
/// A broken header. What is no array of numbers has no reach.
pub fn entries(arrays: &mut Arrays) -> Result<Vec<Entry>, Error> {
    if let Some(root) = arrays.pickled() {
        let mut found = Vec::new();
        collect(&root, DEPTH, &mut found);
        return Ok(found);
    }
    let names = arrays.names();
    let entry = |name: String| {
        let what = arrays.describe(&name)?;
        let reach = arrays.array(&name).ok().flatten().and_then(|array| Reach::of(array.values));
        Ok(Entry { name, what, reach })
    };
    names.into_iter().map(entry).collect()
}

fn collect(field: &Field<'_>, depth: usize, found: &mut Vec<Entry>) {
    let inner = if field.keys().is_ok() && depth > 0 { field.parts() } else { Vec::new() };
    if !inner.is_empty() {
        inner.iter().for_each(|part| collect(part, depth - 1, found));
        return;
    }
    let (what, reach) = match field.array() {
        Ok(array) if array.shape.is_empty() => (array.values[0].to_string(), None),
        Ok(array) => {
            let (what, shape) = (field.describe(), format!("{:?}", array.shape));
            let what = if what.contains(&shape) { what } else { format!("{what}, {shape}") };
            (what, Reach::of(array.values))
        }
        Err(_) => (field.text().map_or_else(|_| field.describe(), |text| format!("{text:?}")), None),
    };
    let name = if field.name().is_empty() { "the whole file" } else { field.name() };
    found.push(Entry { name: name.to_owned(), what, reach });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reach_is_of_finite_numbers() {
        assert_eq!(Reach::of([]), None);
        assert_eq!(Reach::of([2.0, -1.5, 0.0]).unwrap().to_string(), "-1.5000 to 2.0000");
        assert_eq!(Reach::of([2.0, f64::NAN]).unwrap().to_string(), "2.0000 to 2.0000, 1 NaN or infinite");
        assert_eq!(Reach::of([f64::INFINITY]).unwrap().to_string(), "1 NaN or infinite");
    }
}
