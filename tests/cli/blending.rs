//! `blend` on the reference cases, whose files it reads as they are.

use crate::args;
use crate::program::Desk;
use crate::support::{fixture, json};
use serde_json::{Value, json};

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Largest difference of two lists, each divided by the larger of 1 and `scale`.
fn difference(found: &Value, expected: &Value, scale: f64) -> f64 {
    let (found, expected) = (numbers(found), numbers(expected));
    assert_eq!(found.len(), expected.len());
    let largest = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    largest / scale.max(1.0)
}

/// Angle between two unit quaternions as rotations.
fn angle(found: &Value, expected: &Value) -> f64 {
    let (a, b) = (numbers(found), numbers(expected));
    let distance = |sign: f64| a.iter().zip(&b).map(|(a, b)| (a - sign * b).powi(2)).sum::<f64>().sqrt();
    4.0 * (distance(1.0).min(distance(-1.0)) / 2.0).clamp(0.0, 1.0).asin()
}

/// Relative rounding of sums of at most eight products of numbers up to one, with the cancellation that Gram-Schmidt and
/// the 0.1 floor of the raw conversion add.
const ROUNDING: f64 = 1e-14;

#[test]
fn answers_agree_with_the_reference() {
    let desk = Desk::new();
    let (mut cases, mut angles, mut ties) = (0, 0, 0);
    for file in ["rotation/random.json", "rotation/extreme.json"] {
        let answers: Value =
            serde_json::from_str(&desk.ok(args!["blend", fixture(file), "--format", "json"])).unwrap();
        let expected = json(file);
        let pairs = answers.as_array().unwrap().iter().zip(expected.as_array().unwrap());
        assert_eq!(answers.as_array().unwrap().len(), expected.as_array().unwrap().len());
        for (answer, case) in pairs {
            let name = case["name"].as_str().unwrap();
            assert_eq!(answer["name"], case["name"]);
            cases += 1;
            let total: f64 = numbers(&case["weights"]).iter().sum();
            let gap_rel = case["gap_rel"].as_f64().unwrap();
            for (field, reference) in [("blend", "lbs"), ("eigenvalues", "eigenvalues_desc")] {
                let off = difference(&answer[field], &case[reference], total);
                assert!(off < ROUNDING, "{name} {field}: {off:e}");
            }
            let off = difference(&json!([answer["gap"]]), &json!([case["gap"]]), total);
            assert!(off < ROUNDING, "{name} gap: {off:e}");
            // A raw quaternion is of the order of the blend's square root.
            let scale = total.max(1.0).sqrt() * (1.0 + 1.0 / gap_rel.max(1e-8)).sqrt();
            let off = difference(
                &answer["matrix_to_quaternion_raw_wxyz"],
                &case["p3d_matrix_to_quaternion_raw_wxyz"],
                scale,
            );
            assert!(off < ROUNDING, "{name} raw: {off:e}");
            for (field, reference) in
                [("gram_schmidt_columns", "gram_schmidt_cols"), ("gram_schmidt_rows", "gram_schmidt_rows")]
            {
                // The reference leaves ill-posed frames out; how far columns are from parallel is at most the gap.
                if case[reference].is_null() {
                    continue;
                }
                let off = difference(&answer[field], &case[reference], 1.0 / (gap_rel * gap_rel));
                assert!(off < ROUNDING || total < 1e-100, "{name} {field}: {off:e}");
            }
            if case["degenerate"] == true {
                assert_eq!(answer["unique"], false, "{name}");
                ties += 1;
            } else if gap_rel > 1e-8 {
                assert_eq!(answer["unique"], true, "{name}");
                let tolerance = case["suggested_tol_f64_rad"].as_f64().unwrap();
                for field in ["average_wxyz", "polar_wxyz"] {
                    let off = angle(&answer[field], &case["markley_wxyz"]);
                    assert!(off <= tolerance, "{name} {field}: {off:e} rad");
                }
                angles += 1;
            }
        }
    }
    assert_eq!((cases, angles, ties), (508, 479, 3));
}

/// Nlerp is compared where the heaviest bone, to whose side the others are turned, is not in doubt.
#[test]
fn nlerp_agrees_with_the_reference() {
    let desk = Desk::new();
    let answers: Value =
        serde_json::from_str(&desk.ok(args!["blend", fixture("rotation/random.json"), "--format", "json"]))
            .unwrap();
    let mut compared = 0;
    for (answer, case) in
        answers.as_array().unwrap().iter().zip(json("rotation/random.json").as_array().unwrap())
    {
        let off = angle(&answer["nlerp_wxyz"], &case["nlerp_maxw_wxyz"]);
        assert!(off < 1e-13, "{}: {off:e}", case["name"]);
        compared += 1;
    }
    assert_eq!(compared, 384);
}

#[test]
fn text_says_what_is_not_unique() {
    let desk = Desk::new();
    desk.put(
        "cases.json",
        r#"[{"name":"quarter turns","quats_wxyz":[[1,0,0,0],[1,0,0,1]],"weights":[1,1]},
            {"name":"half a turn","quats_wxyz":[[1,0,0,0],[0,0,0,2]],"weights":[0.5,0.5]}]"#,
    );
    let text = desk.ok(args!["blend", "cases.json"]);
    assert!(
        text.contains(
            "quarter turns\n  average               +0.923879533 +0.000000000 +0.000000000 +0.382683432"
        ),
        "{text}"
    );
    assert_eq!(text.matches("not unique").count(), 1, "{text}");
    assert!(text.contains("undefined: the blend does not span a frame"), "{text}");
}

#[test]
fn cases_that_mean_nothing_are_named() {
    let desk = Desk::new();
    for (content, parts) in [
        ("", vec!["cases.json", "line 1"]),
        ("{}", vec!["cases.json", "sequence"]),
        (r#"[{"name":"a","quats_wxyz":[[1,0,0]],"weights":[1]}]"#, vec!["cases.json", "length 3", "4"]),
        (r#"[{"name":"a","quats_wxyz":[[1,0,0,0]]}]"#, vec!["cases.json", "weights"]),
        (
            r#"[{"name":"a","quats_wxyz":[[1,0,0,0]],"weights":[1,2]}]"#,
            vec!["case 0 `a`", "1 quats_wxyz and 2 weights", "expected"],
        ),
        (r#"[{"name":"a","quats_wxyz":[],"weights":[]}]"#, vec!["case 0 `a`", "at least one"]),
        (r#"[{"name":"a","quats_wxyz":[[0,0,0,0]],"weights":[1]}]"#, vec!["case 0 `a`", "expected finite"]),
        (r#"[{"name":"a","quats_wxyz":[[1,0,0,0]],"weights":[0]}]"#, vec!["case 0 `a`", "not all 0"]),
        (r#"[{"name":"a","quats_wxyz":[[1,0,0,0],[1,0,0,0]],"weights":[2,-1]}]"#, vec!["case 0 `a`", ">= 0"]),
        (r#"[{"name":"a","quats_wxyz":[[1e999,0,0,0]],"weights":[1]}]"#, vec!["cases.json"]),
    ] {
        desk.put("cases.json", content);
        desk.run(args!["blend", "cases.json", "--format", "json"]).refuses(&parts, content);
    }
}
