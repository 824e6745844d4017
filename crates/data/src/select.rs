//! Which of many to keep: frames, sentences.

/// At most `limit` of `items`, evenly spaced: the items are cut into `limit` equal stretches and the middle of each is
/// taken, item `floor((2 i + 1) n / (2 limit))` for i = 0, 1, ... The choice depends on the count alone.
pub fn evenly_spaced<T: Copy>(items: &[T], limit: Option<usize>) -> Vec<T> {
    let n = items.len();
    match limit {
        Some(k) if k < n => (0..k).map(|i| items[(2 * i + 1) * n / (2 * k)]).collect(),
        _ => items.to_vec(),
    }
}

/// Every item where it is first met.
pub fn each_once<T: PartialEq>(items: Vec<T>) -> Vec<T> {
    let mut kept: Vec<T> = Vec::with_capacity(items.len());
    for item in items {
        if !kept.contains(&item) {
            kept.push(item);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_repeats_is_kept_where_it_is_first_met() {
        assert_eq!(each_once(vec!["b", "a", "b", "c", "a"]), ["b", "a", "c"]);
    }

    #[test]
    fn frames_are_thinned_from_the_middle_of_equal_stretches() {
        let items: Vec<usize> = (0..10).collect();
        assert_eq!(evenly_spaced(&items, Some(5)), [1, 3, 5, 7, 9]);
        assert_eq!(evenly_spaced(&items, Some(3)), [1, 5, 8]);
        assert_eq!(evenly_spaced(&items, Some(1)), [5]);
        assert_eq!(evenly_spaced(&items, Some(0)), [0; 0]);
        assert_eq!(evenly_spaced(&items, Some(10)), items);
        assert_eq!(evenly_spaced(&items, None), items);
    }
}
