//! Which values are the best.

use super::{Cell, Content, Direction};

/// Marks the best cells of each column among rows that compare with each other. Equal digits are equally good. Nothing
/// is marked in a column without a direction, where a number is missing or rests on a smaller sample than planned, or
/// where there is only one number: there the rows do not compare.
pub fn mark_best(rows: &mut [&mut Vec<Cell>], directions: &[Option<Direction>]) {
    for (c, direction) in directions.iter().enumerate() {
        let Some(direction) = direction else { continue };
        let values: Vec<f64> = rows.iter().filter_map(|cells| cells[c].printed()).collect();
        let comparable = rows.iter().all(|cells| {
            let cell = &cells[c];
            cell.missing == 0 && (cell.content.value().is_some() || cell.content == Content::NotApplicable)
        });
        if !comparable || values.len() < 2 {
            continue;
        }
        let better = match direction {
            Direction::Higher => f64::max,
            Direction::Lower => f64::min,
        };
        let best = values.into_iter().fold(f64::NAN, better);
        for cells in rows.iter_mut() {
            cells[c].best = cells[c].printed() == Some(best);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Digits;
    use super::*;
    use Direction::{Higher, Lower};

    fn number(value: f64, decimals: usize) -> Cell {
        Cell::number(value, Digits::Decimals(decimals))
    }

    fn bests(direction: impl Into<Option<Direction>>, cells: Vec<Cell>) -> Vec<bool> {
        let mut rows: Vec<Vec<Cell>> = cells.into_iter().map(|cell| vec![cell]).collect();
        mark_best(&mut rows.iter_mut().collect::<Vec<_>>(), &[direction.into()]);
        rows.iter().map(|cells| cells[0].best).collect()
    }

    #[test]
    fn digits_decide_and_ties_are_both_best() {
        assert_eq!(bests(Higher, vec![number(22.071, 2), number(22.069, 2)]), [true, true]);
        assert_eq!(bests(Higher, vec![number(22.07, 2), number(22.08, 2)]), [false, true]);
        assert_eq!(bests(Lower, vec![number(0.1, 4), number(0.2, 4)]), [true, false]);
        assert_eq!(bests(Lower, vec![number(10.0, 0), number(9.0, 0)]), [false, true]);
        assert_eq!(bests(Higher, vec![number(f64::INFINITY, 2), number(90.0, 2)]), [true, false]);
        assert_eq!(bests(None, vec![number(1.0, 0), number(2.0, 0)]), [false, false]);
    }

    #[test]
    fn rows_that_do_not_compare_have_no_best() {
        let short = Cell { missing: 1, ..number(30.0, 2) };
        assert_eq!(bests(Higher, vec![short, number(20.0, 2)]), [false, false]);
        let none = Cell::new(Content::NotComputed, Digits::Decimals(4));
        assert_eq!(bests(Lower, vec![none.clone(), number(0.1, 4)]), [false, false]);
        assert_eq!(bests(Lower, vec![none.clone(), none]), [false, false]);
        assert_eq!(bests(Lower, vec![Cell::empty(), number(9.0, 0)]), [false, false]);
        assert_eq!(bests(Lower, vec![Cell::empty(), number(9.0, 0), number(8.0, 0)]), [false, false, true]);
    }
}
