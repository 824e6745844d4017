//! The Pareto front.

/// For each point (smaller is better in every coordinate), whether no other is at least as good in all of them and better
/// in one. Points that are equal in all stand or fall together; a point with NaN is never on the front.
pub fn pareto_front<const N: usize>(points: &[[f64; N]]) -> Vec<bool> {
    let sound = |p: &[f64; N]| !p.iter().any(|v| v.is_nan());
    let dominates = |a: &[f64; N], b: &[f64; N]| a != b && a.iter().zip(b).all(|(a, b)| a <= b);
    points.iter().map(|p| sound(p) && !points.iter().any(|q| dominates(q, p))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::{prop_assert, prop_assert_eq, proptest};

    #[test]
    fn a_known_front() {
        let points =
            [[1.0, 5.0], [2.0, 5.0], [2.0, 3.0], [2.0, 3.0], [4.0, 0.0], [5.0, 0.0], [0.0, f64::NAN]];
        assert_eq!(pareto_front(&points), [true, false, true, true, true, false, false]);
        assert!(pareto_front::<2>(&[]).is_empty());
        // Better in the third coordinate alone.
        assert_eq!(pareto_front(&[[1.0, 1.0, 2.0], [2.0, 2.0, 1.0], [2.0, 2.0, 2.0]]), [true, true, false]);
    }

    proptest! {
        /// Few distinct values, so that ties occur. In two dimensions a sweep in the order of the cost finds the front by
        /// another way: a point is on it if it has the least error of its cost and less than all that cost less.
        #[test]
        fn exactly_the_points_that_a_sweep_finds(
            points in proptest::collection::vec(proptest::array::uniform2(0_u8..6), 1..30)
        ) {
            let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(f64::from)).collect();
            let front = pareto_front(&points);
            for (i, &[cost, error]) in points.iter().enumerate() {
                let cheaper = points.iter().filter(|p| p[0] < cost).map(|p| p[1]);
                let equal = points.iter().filter(|p| p[0] == cost).map(|p| p[1]);
                let on_front = cheaper.fold(f64::INFINITY, f64::min) > error
                    && equal.fold(f64::INFINITY, f64::min) == error;
                prop_assert_eq!(front[i], on_front);
            }
            prop_assert!(front.contains(&true));
        }

        #[test]
        fn the_order_does_not_matter(
            points in proptest::collection::vec(proptest::array::uniform3(0_u8..5), 0..20)
        ) {
            let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
            let reversed: Vec<[f64; 3]> = points.iter().rev().copied().collect();
            let mut front = pareto_front(&reversed);
            front.reverse();
            prop_assert_eq!(front, pareto_front(&points));
        }
    }
}
