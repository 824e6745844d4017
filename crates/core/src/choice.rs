//! What a name may be, for messages: all that is known, and which of it was probably meant.

/// How alike two names are from which on one may be a slip of the other: 1 is equal, one letter of four wrong is 0.75.
const ALIKE: f64 = 0.65;

/// The known name that is most like the given one (of `a/b` also `b` alone), unless none is like it.
pub fn nearest<'k, S: AsRef<str>>(given: &str, known: &'k [S]) -> Option<&'k str> {
    let likeness = |name: &str| {
        let last = name.rsplit_once('/').map_or(name, |(_, last)| last);
        let [whole, last] =
            [name, last].map(|name| strsim::normalized_damerau_levenshtein(&given.to_lowercase(), name));
        whole.max(last)
    };
    let rated = known.iter().map(|name| (name.as_ref(), likeness(name.as_ref())));
    let best = rated.max_by(|(_, a), (_, b)| a.total_cmp(b));
    best.filter(|(_, likeness)| *likeness >= ALIKE).map(|(name, _)| name)
}

/// `one of a, b, c`, and which of them was probably meant: what was expected where something else was given.
pub fn one_of<S: AsRef<str>>(given: &str, known: &[S]) -> String {
    let list = known.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    if list.is_empty() {
        return "nothing: there is none to choose from".to_owned();
    }
    match nearest(given, known) {
        Some(meant) => format!("one of {list}; is `{meant}` meant?"),
        None => format!("one of {list}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_recognised_and_a_stranger_is_not() {
        let known = ["table1", "swap", "synthetic/ring_stripes"];
        assert_eq!(nearest("tabel1", &known), Some("table1"));
        assert_eq!(nearest("Swap", &known), Some("swap"));
        assert_eq!(nearest("ring_stripe", &known), Some("synthetic/ring_stripes"));
        assert_eq!(nearest("budget", &known), None);
        assert_eq!(nearest::<&str>("swap", &[]), None);
        assert_eq!(one_of("swp", &["lbs", "swap"]), "one of lbs, swap; is `swap` meant?");
        assert_eq!(one_of("x", &["lbs", "swap"]), "one of lbs, swap");
        assert!(one_of::<&str>("x", &[]).starts_with("nothing"));
    }
}
