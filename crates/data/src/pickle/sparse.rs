//! Matrices of `scipy.sparse`, by rows.

use super::class::Class;
use super::{Array, Error, Field};

/// A matrix by its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Rows and columns.
    pub shape: [usize; 2],
    /// Per row, columns ascending and the values there; zeros are left out.
    pub rows: Vec<Vec<(u32, f64)>>,
}

impl Rows {
    /// Of an array with two axes.
    pub(crate) fn dense(array: &Array) -> Option<Self> {
        let &[height, width] = &array.shape[..] else { return None };
        let sparse = |row: &[f64]| {
            row.iter()
                .enumerate()
                .filter(|(_, value)| **value != 0.0)
                .map(|(i, &value)| (i as u32, value))
                .collect()
        };
        let rows = if width == 0 {
            vec![Vec::new(); height]
        } else {
            array.values.chunks_exact(width).map(sparse).collect()
        };
        Some(Self { shape: [height, width], rows })
    }

    /// As an array of at most so many values.
    pub(super) fn to_dense(&self, limit: usize) -> Option<Array> {
        let [height, width] = self.shape;
        let count = height.checked_mul(width).filter(|&count| count <= limit)?;
        let mut values = vec![0.0; count];
        for (i, row) in self.rows.iter().enumerate() {
            row.iter().for_each(|&(column, value)| values[i * width + column as usize] = value);
        }
        Some(Array { shape: vec![height, width], values })
    }
}

/// The matrix of a state: `_shape`, `data`, and `indices` with `indptr`, or `row` with `col`, or `coords`.
pub(super) fn rows(state: &Field<'_>, class: Class) -> Result<Rows, Error> {
    let shape = match state.optional("_shape")? {
        Some(shape) => shape,
        None => state.get("shape")?,
    };
    let &[height, width] = &whole(&shape)?[..] else {
        return Err(shape.invalid("not two extents", "rows and columns"));
    };
    let values = state.get("data")?.numbers("N")?.values;
    let entries = match class {
        Class::Coo => coordinates(state)?,
        _ => compressed(state, class, [height, width])?,
    };
    if entries.len() != values.len() {
        return Err(
            state.invalid(format!("{} places for {} values", entries.len(), values.len()), "one for each")
        );
    }
    // A row takes memory whether or not it has entries: as many as columns and entries of the file can name.
    if height > values.len().saturating_mul(64) + (1 << 16) {
        return Err(state.invalid(format!("{height} rows of {} values", values.len()), "a matrix of joints"));
    }
    let mut rows = vec![Vec::new(); height];
    for (&(row, column), &value) in entries.iter().zip(&values) {
        if row >= height || column >= width || column > u32::MAX as usize {
            let expected = format!("rows below {height}, columns below {width}");
            return Err(state.invalid(format!("an entry at ({row}, {column})"), expected));
        }
        rows[row].push((column as u32, value));
    }
    for row in &mut rows {
        row.sort_by_key(|&(column, _)| column);
        // Entries of one place add up.
        row.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            kept.1 += if same { next.1 } else { 0.0 };
            same
        });
    }
    Ok(Rows { shape: [height, width], rows })
}

fn whole(field: &Field<'_>) -> Result<Vec<usize>, Error> {
    let values = field.array()?.values;
    if let Some(value) = values.iter().find(|v| !(**v >= 0.0 && v.fract() == 0.0 && **v < 9e15)) {
        return Err(field.invalid(format!("{value}"), "whole numbers, at least 0"));
    }
    Ok(values.iter().map(|&v| v as usize).collect())
}

fn coordinates(state: &Field<'_>) -> Result<Vec<(usize, usize)>, Error> {
    let [rows, columns] = if state.contains("coords") {
        let coords = state.get("coords")?;
        match &coords.items()?[..] {
            [rows, columns] => [whole(rows)?, whole(columns)?],
            _ => return Err(coords.invalid("not two lists", "rows and columns")),
        }
    } else {
        [whole(&state.get("row")?)?, whole(&state.get("col")?)?]
    };
    Ok(rows.into_iter().zip(columns).collect())
}

/// Column by column (csc) or row by row (csr).
fn compressed(
    state: &Field<'_>,
    class: Class,
    [height, width]: [usize; 2],
) -> Result<Vec<(usize, usize)>, Error> {
    let (pointer, indices) = (whole(&state.get("indptr")?)?, whole(&state.get("indices")?)?);
    let lines = if class == Class::Csc { width } else { height };
    let sorted = pointer.is_sorted() && pointer.first() == Some(&0) && pointer.last() == Some(&indices.len());
    if pointer.len() != lines.saturating_add(1) || !sorted {
        let expected = format!("{lines} + 1 ascending numbers from 0 to {}", indices.len());
        return Err(state.get("indptr")?.invalid("other numbers", expected));
    }
    let mut entries = Vec::with_capacity(indices.len());
    for (line, ends) in pointer.windows(2).enumerate() {
        let places = indices[ends[0]..ends[1]].iter();
        entries.extend(places.map(|&place| if class == Class::Csc { (place, line) } else { (line, place) }));
    }
    Ok(entries)
}
