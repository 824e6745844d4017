//! Ways to blend rotations, besides the average: all that are told apart, and their names.

use super::convention::Convention;
use super::wiring::{Blend, Conversion, From, GramSchmidt, Of, Signs, Space};
use serde_json::{Value, json};

/// Longest power iteration that is told apart from the average.
const MOST_STEPS: u32 = 20;

/// Every way to blend rotations that is told apart.
pub(crate) fn blends(spaces: &[Space]) -> Vec<Blend> {
    let mut all = Vec::new();
    all.extend((0..=MOST_STEPS).map(|steps| Blend::Power(steps, From::Heaviest)));
    for from in [From::Ones, From::Identity] {
        all.extend((1..=MOST_STEPS).map(|steps| Blend::Power(steps, from)));
    }
    let mut signs = vec![Signs::Heaviest, Signs::Running, Signs::Given, Signs::NonNegativeW, Signs::Chained];
    for &space in spaces {
        signs.extend([Signs::LargestPositive(space), Signs::FromMatrices(space)]);
    }
    all.extend(signs.iter().copied().map(Blend::Sum));
    all.extend(signs.into_iter().map(Blend::Dual));
    all.extend(gram_schmidts().map(Blend::GramSchmidt));
    for of in [Of::Blend, Of::Product] {
        let conversions = [Conversion::Largest, Conversion::TraceFirst, Conversion::FourRoots];
        all.extend(conversions.map(|conversion| Blend::Converted(conversion, of)));
    }
    all
}

/// Every order of two axes: engines' axes are ours in another order, and programs start with the axis that they please.
fn gram_schmidts() -> impl Iterator<Item = GramSchmidt> {
    // Of rows the canonical rotation makes no difference: it turns them all.
    let ways = [(false, Of::Blend), (false, Of::Product), (true, Of::Blend)];
    let axes = (0..3).flat_map(|first| [1, 2].map(|step| (first, (first + step) % 3)));
    ways.into_iter().flat_map(move |(rows, of)| {
        axes.clone().map(move |(first, second)| GramSchmidt { rows, first, second, of })
    })
}

/// The name under which it is reported.
pub(crate) fn kind_of_blend(blend: &Blend) -> &'static str {
    match blend {
        Blend::Average => "average",
        Blend::Power(..) => "too-few-power-steps",
        Blend::Sum(Signs::Heaviest | Signs::Running) => "normalised-sum",
        Blend::Sum(_) => "signs-not-aligned",
        Blend::GramSchmidt(_) => "gram-schmidt",
        Blend::Converted(..) => "matrix-to-quaternion",
        Blend::Dual(_) => "dual-quaternions",
    }
}

/// What else is known of it, for the report; axes are named as `convention` has them.
pub(crate) fn details_of_blend(blend: &Blend, convention: &Convention) -> Value {
    let named = |signs: &Signs| match signs {
        Signs::Heaviest => "aligned to the heaviest bone",
        Signs::Running => "aligned to the running sum",
        Signs::Given => "as given",
        Signs::NonNegativeW => "w >= 0",
        Signs::LargestPositive(_) => "largest component positive",
        Signs::FromMatrices(_) => "as read from matrices, w > 0 where the trace is",
        Signs::Chained => "of products along the chain",
    };
    let of = |of: &Of| match of {
        Of::Blend => "blended matrix",
        Of::Product => "blended matrix times canonical rotation",
    };
    match blend {
        Blend::Average => json!({}),
        Blend::Power(steps, from) => json!({ "steps": steps, "start": match from {
            From::Heaviest => "heaviest bone",
            From::Ones => "(1, 1, 1, 1)/2",
            From::Identity => "identity",
        } }),
        Blend::Sum(signs) | Blend::Dual(signs) => json!({ "signs": named(signs) }),
        Blend::GramSchmidt(way) => {
            let axes = [way.first, way.second].map(|axis| convention.axis_name(axis)).join(", then ");
            let over = if way.rows { "rows" } else { "columns" };
            json!({ "over": over, "axes": axes, "of": of(&way.of) })
        }
        Blend::Converted(conversion, m) => json!({ "of": of(m), "branches": match conversion {
            Conversion::Largest => "largest component",
            Conversion::TraceFirst => "trace first",
            Conversion::FourRoots => "four square roots",
        } }),
    }
}

/// It in a sentence.
pub(crate) fn summary_of_blend(blend: &Blend) -> String {
    match blend {
        Blend::Average => "the average".to_owned(),
        Blend::Power(0, _) => "Gaussians turn with their heaviest bone alone: no power step".to_owned(),
        Blend::Power(15, _) => {
            "15 power steps towards the average, as many as the paper takes: the widest bends end as far from it as is said here"
                .to_owned()
        }
        Blend::Power(steps, _) => {
            format!("{steps} power step(s) towards the average, which are not enough for the widest bends")
        }
        Blend::Sum(Signs::Heaviest | Signs::Running) => {
            "the normalised sum of aligned quaternions in place of the average".to_owned()
        }
        Blend::Sum(_) => "quaternions were summed without aligning their signs".to_owned(),
        Blend::GramSchmidt(_) => {
            "Gram-Schmidt of the blended matrix in place of the average".to_owned()
        }
        Blend::Converted(..) => {
            "a quaternion read from the blended matrix, which is no rotation, in place of the average"
                .to_owned()
        }
        Blend::Dual(Signs::Heaviest | Signs::Running) => {
            "dual-quaternion blending in place of the average".to_owned()
        }
        Blend::Dual(_) => "dual-quaternion blending without aligned signs in place of the average".to_owned(),
    }
}
