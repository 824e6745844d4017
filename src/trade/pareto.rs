//! The Pareto front.

/// For each point (cost, error), whether no other is at least as good in both and better in one. Points that are equal in
/// both stand or fall together; a point with NaN is never on the front.
pub fn pareto_front(points: &[[f64; 2]]) -> Vec<bool> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| points[i].iter().all(|v| !v.is_nan())).collect();
    order.sort_by(|&i, &j| points[i][0].total_cmp(&points[j][0]).then(points[i][1].total_cmp(&points[j][1])));
    let mut on_front = vec![false; points.len()];
    let mut best: Option<[f64; 2]> = None;
    for i in order {
        let point = points[i];
        if best.is_none_or(|best| point[1] < best[1] || point == best) {
            on_front[i] = true;
            best = Some(point);
        }
    }
    on_front
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::{prop_assert, prop_assert_eq, proptest};

    fn dominates(a: [f64; 2], b: [f64; 2]) -> bool {
        a[0] <= b[0] && a[1] <= b[1] && a != b
    }

    #[test]
    fn a_known_front() {
        let points =
            [[1.0, 5.0], [2.0, 5.0], [2.0, 3.0], [2.0, 3.0], [4.0, 0.0], [5.0, 0.0], [3.0, f64::NAN]];
        assert_eq!(pareto_front(&points), [true, false, true, true, true, false, false]);
        assert!(pareto_front(&[]).is_empty());
    }

    proptest! {
        /// The definition, point by point; few distinct values, so that ties occur.
        #[test]
        fn exactly_the_points_that_nothing_dominates(
            points in proptest::collection::vec(proptest::array::uniform2(0_u8..6), 0..30)
        ) {
            let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(f64::from)).collect();
            let front = pareto_front(&points);
            for (i, &p) in points.iter().enumerate() {
                prop_assert_eq!(front[i], !points.iter().any(|&q| dominates(q, p)));
            }
            prop_assert!(points.is_empty() || front.contains(&true));
        }
    }
}
