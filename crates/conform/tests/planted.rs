//! Every bug is planted by an engine of the tests' own and has to be named, in JSON, in flat binary and in PLY; so are pairs.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, unreachable_pub, reason = "tests")]

mod engine;

use engine::{FIELDS, Inputs, Outs, binary, halved, json_of, ply, skin};
use skinsplat_conform::{Cases, Convention, Error, Options, Report, Verdict, check, export};
use std::path::PathBuf;
use std::sync::OnceLock;

/// A small rig, and what the tests' engine reads of it.
struct Bench {
    folder: tempfile::TempDir,
    inputs: Inputs,
}

fn bench() -> &'static Bench {
    static BENCH: OnceLock<Bench> = OnceLock::new();
    BENCH.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        export(folder.path(), Cases::Small, &Convention::default()).unwrap();
        let inputs = Inputs::of(folder.path());
        Bench { folder, inputs }
    })
}

fn judged(answer: PathBuf) -> Result<Report, Error> {
    check(bench().folder.path(), &answer, &Options::default())
}

fn of_text(text: impl AsRef<[u8]>) -> Result<Report, Error> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    judged(file.path().to_owned())
}

fn of_json(outs: &Outs) -> Report {
    of_text(json_of(outs, &FIELDS)).unwrap()
}

fn of_ply(outs: &Outs, activated: &[&str]) -> Report {
    let folder = tempfile::tempdir().unwrap();
    ply(outs, folder.path(), activated);
    judged(folder.path().to_owned()).unwrap()
}

/// The kinds, sorted.
fn kinds(report: &Report) -> Vec<String> {
    let mut kinds: Vec<String> = report.kinds().into_iter().map(str::to_owned).collect();
    kinds.sort();
    kinds
}

fn expect(report: &Report, expected: &[&str], what: &str) {
    let mut expected: Vec<&str> = expected.to_vec();
    expected.sort_unstable();
    assert_eq!(report.verdict, Verdict::Differs, "{what}");
    assert_eq!(kinds(report), expected, "{what}: {}", report.text());
}

#[test]
fn a_right_engine_conforms() {
    let outs = skin(&bench().inputs, &[]);
    for report in [of_json(&outs), of_text(binary(&outs, "")).unwrap(), of_ply(&outs, &[])] {
        assert_eq!(report.verdict, Verdict::Conforms, "{}", report.text());
        assert!(report.explanations.is_empty());
    }
    for name in ["vectors.json", "vectors.bin", "expected", "expected/pose_0003.ply"] {
        let report = judged(bench().folder.path().join(name)).unwrap();
        assert_eq!(report.verdict, Verdict::Conforms, "{name}: {}", report.text());
    }
}

/// What is planted, and the names that it has to be given.
const SINGLES: [(&str, &[&str]); 45] = [
    ("transposed-joints", &["row-major-matrices", "transposed"]),
    ("row-major-matrices", &["row-major-matrices"]),
    ("relative-conjugated", &["conjugated", "transposed"]),
    ("posed-conjugated", &["conjugated", "transposed"]),
    ("xyzw-for-wxyz", &["xyzw-for-wxyz"]),
    ("canonical-xyzw", &["xyzw-for-wxyz"]),
    ("joints-xyzw", &["xyzw-for-wxyz"]),
    ("signs-not-aligned", &["signs-not-aligned"]),
    ("not-normalised", &["not-normalised"]),
    ("normalised-sum", &["normalised-sum"]),
    ("gram-schmidt", &["gram-schmidt"]),
    ("matrix-to-quaternion", &["matrix-to-quaternion"]),
    ("dual-quaternions", &["dual-quaternions"]),
    ("power-3", &["too-few-power-steps"]),
    ("power-6", &["too-few-power-steps"]),
    ("sh-not-turned", &["sh-not-turned"]),
    ("sh-turned-backwards", &["sh-turned-backwards"]),
    ("sh-only-first-band-turned", &["sh-not-turned"]),
    ("sh-basis-sign-out", &["sh-basis-sign"]),
    ("sh-basis-sign-while", &["sh-basis-sign"]),
    ("mirrored-handedness", &["mirrored-handedness"]),
    ("y-up-for-z-up", &["y-up-for-z-up"]),
    ("degrees-for-radians", &["degrees-for-radians"]),
    ("degrees-handed-in", &["degrees-for-radians"]),
    ("weights-not-normalised", &["weights-not-normalised"]),
    ("weights-cut-to-four", &["weights-cut-to-four"]),
    ("weights-quantised", &["weights-quantised"]),
    ("bind-pose-missing", &["bind-pose-missing"]),
    ("scale-ignored", &["scale-ignored"]),
    ("scale-ball", &["scale-ignored"]),
    ("one-frame-late", &["one-frame-late"]),
    ("one-frame-early", &["one-frame-early"]),
    ("local-conjugated", &["conjugated", "transposed"]),
    ("local-xyzw", &["xyzw-for-wxyz"]),
    ("local-wxyz", &["xyzw-for-wxyz"]),
    ("chain-reversed", &["chain-reversed"]),
    ("bind-on-other-side", &["bind-pose-on-other-side"]),
    ("translation-missing", &["translation-missing"]),
    ("translation-before", &["translation-before-skinning"]),
    ("canonical-conjugated", &["conjugated", "transposed"]),
    ("signs-from-matrices", &["signs-not-aligned"]),
    ("gram-schmidt-z-first", &["gram-schmidt"]),
    ("gram-schmidt-rows", &["gram-schmidt"]),
    ("gram-schmidt-rows-z-first", &["gram-schmidt"]),
    ("bgr-for-rgb", &["bgr-for-rgb"]),
];

#[test]
fn single_bugs_are_named_in_json() {
    for (bug, expected) in SINGLES {
        let report = of_json(&skin(&bench().inputs, &[bug]));
        expect(&report, expected, bug);
    }
}

#[test]
fn single_bugs_are_named_in_flat_binary() {
    for (bug, expected) in SINGLES {
        // Means, quaternions and SH alone do not tell of scales.
        if !bug.starts_with("scale-") {
            let report = of_text(binary(&skin(&bench().inputs, &[bug]), "skinsplat")).unwrap();
            for kind in expected {
                assert!(report.kinds().contains(kind), "{bug}: {}", report.text());
            }
            assert!(report.kinds().len() <= expected.len() + 1, "{bug}: {}", report.text());
            assert_eq!(report.not_judged, ["scales", "covariances", "directions", "opacities"]);
        }
    }
}

#[test]
fn single_bugs_are_named_in_ply() {
    for (bug, expected) in SINGLES {
        let report = of_ply(&skin(&bench().inputs, &[bug]), &[]);
        for kind in expected {
            assert!(report.kinds().contains(kind), "{bug}: {}", report.text());
        }
        assert!(report.kinds().len() <= expected.len() + 1, "{bug}: {}", report.text());
    }
    let right = skin(&bench().inputs, &[]);
    expect(&of_ply(&right, &["opacity"]), &["activated-opacity"], "opacity");
    expect(&of_ply(&right, &["scale"]), &["activated-scale"], "scale");
    expect(&of_ply(&right, &["scale", "opacity"]), &["activated-opacity", "activated-scale"], "both");
}

/// Only directions tell.
#[test]
fn reversed_directions_are_named() {
    let report = of_json(&skin(&bench().inputs, &["direction-reversed"]));
    expect(&report, &["direction-reversed"], "from the Gaussian to the camera");
    assert_eq!(report.explanations[0]["fields"], serde_json::json!(["directions"]));
}

#[test]
fn what_is_known_of_a_bug_is_said() {
    let detail = |bug: &str, key: &str| {
        let report = of_json(&skin(&bench().inputs, &[bug]));
        report.explanations[0][key].clone()
    };
    assert_eq!(detail("power-3", "steps"), 3);
    assert_eq!(detail("power-6", "steps"), 6);
    assert_eq!(detail("sh-only-first-band-turned", "bands"), serde_json::json!([2, 3]));
    assert_eq!(detail("sh-not-turned", "bands"), serde_json::json!([1, 2, 3]));
    assert_eq!(detail("sh-basis-sign-out", "coefficients"), serde_json::json!([1, 3, 5, 7, 9, 11, 13, 15]));
    assert_eq!(detail("mirrored-handedness", "axis"), "x");
    let sums = detail("weights-not-normalised", "sums");
    assert!((sums[0].as_f64().unwrap() - 0.9).abs() < 1e-6, "{sums}");
    assert_eq!(detail("weights-quantised", "levels"), 255);
}

/// Two bugs at once, and both names.
const PAIRS: [([&str; 2], &[&str]); 19] = [
    (["xyzw-for-wxyz", "sh-not-turned"], &["sh-not-turned", "xyzw-for-wxyz"]),
    (["signs-not-aligned", "sh-not-turned"], &["sh-not-turned", "signs-not-aligned"]),
    (["dual-quaternions", "weights-cut-to-four"], &["dual-quaternions", "weights-cut-to-four"]),
    (["scale-ignored", "one-frame-late"], &["one-frame-late", "scale-ignored"]),
    (["gram-schmidt", "mirrored-handedness"], &["gram-schmidt", "mirrored-handedness"]),
    (["bind-pose-missing", "xyzw-for-wxyz"], &["bind-pose-missing", "xyzw-for-wxyz"]),
    (["y-up-for-z-up", "sh-turned-backwards"], &["sh-turned-backwards", "y-up-for-z-up"]),
    (["matrix-to-quaternion", "one-frame-late"], &["matrix-to-quaternion", "one-frame-late"]),
    (["power-3", "weights-cut-to-four"], &["too-few-power-steps", "weights-cut-to-four"]),
    (["weights-not-normalised", "sh-not-turned"], &["sh-not-turned", "weights-not-normalised"]),
    (["weights-not-normalised", "one-frame-late"], &["one-frame-late", "weights-not-normalised"]),
    (
        ["weights-cut-not-normalised", "xyzw-for-wxyz"],
        &["weights-cut-to-four", "weights-not-normalised", "xyzw-for-wxyz"],
    ),
    (["mirrored-shape", "weights-eleven-tenths"], &["mirrored-handedness", "weights-not-normalised"]),
    (["y-up-for-z-up", "weights-eleven-tenths"], &["weights-not-normalised", "y-up-for-z-up"]),
    (["translation-missing", "sh-not-turned"], &["sh-not-turned", "translation-missing"]),
    (["sh-backwards-and-not", "scale-ignored"], &["scale-ignored", "sh-not-turned", "sh-turned-backwards"]),
    (["not-normalised", "weights-quantised"], &["not-normalised", "weights-quantised"]),
    (["direction-reversed", "sh-not-turned"], &["direction-reversed", "sh-not-turned"]),
    (["sh-basis-sign-out", "signs-not-aligned"], &["sh-basis-sign", "signs-not-aligned"]),
];

#[test]
fn pairs_of_bugs_are_named() {
    for (bugs, expected) in PAIRS {
        let report = of_json(&skin(&bench().inputs, &bugs));
        if bugs[0] == "weights-cut-not-normalised" {
            // Three, in truth: two of them have to be named, and nothing that is not there.
            assert!(
                report.kinds().iter().all(|k| expected.contains(k) || *k == "unknown"),
                "{}",
                report.text()
            );
            continue;
        }
        expect(&report, expected, &format!("{bugs:?}"));
        assert_eq!(report.alternatives, 1, "{bugs:?}: {}", report.text());
    }
    let cut = of_json(&skin(&bench().inputs, &["weights-cut-not-normalised"]));
    expect(&cut, &["weights-cut-to-four", "weights-not-normalised"], "cut");
}

/// A rig in another convention, and the kinds of an engine with these bugs, which computes in its axes.
fn named_in(convention: &str, plants: &[&[&str]]) -> Vec<(Report, String)> {
    let folder = tempfile::tempdir().unwrap();
    export(folder.path(), Cases::Small, &convention.parse().unwrap()).unwrap();
    let inputs = Inputs::of(folder.path());
    let xyzw = std::fs::read_to_string(folder.path().join("vectors.json")).unwrap().contains("\"xyzw\"");
    let file = folder.path().join("answer.json");
    let named = |bugs: &&[&str]| {
        let mut outs = skin(&inputs, bugs);
        for o in outs.iter_mut().flatten().filter(|_| xyzw) {
            o.quat = [o.quat[1], o.quat[2], o.quat[3], o.quat[0]];
        }
        std::fs::write(&file, json_of(&outs, &FIELDS)).unwrap();
        let report = check(folder.path(), &file, &Options::default()).unwrap();
        (report, format!("{convention}: {bugs:?}"))
    };
    plants.iter().map(named).collect()
}

/// Bugs of stages that depend on axes and units are those of the axes that the vectors are in.
#[test]
fn bugs_are_named_in_the_axes_of_the_vectors() {
    const PLANTS: [(&[&str], &[&str]); 17] = [
        (&["joints-xyzw"], &["xyzw-for-wxyz"]),
        (&["canonical-xyzw"], &["xyzw-for-wxyz"]),
        (&["local-xyzw"], &["xyzw-for-wxyz"]),
        (&["local-wxyz"], &["xyzw-for-wxyz"]),
        (&["local-conjugated"], &["conjugated", "transposed"]),
        (&["canonical-conjugated"], &["conjugated", "transposed"]),
        (&["gram-schmidt"], &["gram-schmidt"]),
        (&["gram-schmidt-z-first"], &["gram-schmidt"]),
        (&["gram-schmidt-y-z"], &["gram-schmidt"]),
        (&["gram-schmidt-rows"], &["gram-schmidt"]),
        (&["gram-schmidt", "sh-not-turned"], &["gram-schmidt", "sh-not-turned"]),
        (&["signs-from-matrices"], &["signs-not-aligned"]),
        (&["scale-ignored"], &["scale-ignored"]),
        (&["scale-not-activated"], &["scale-not-activated"]),
        (&["activated-scale"], &["activated-scale"]),
        (&["sh-basis-sign-while"], &["sh-basis-sign"]),
        (&["bgr-for-rgb", "one-frame-early"], &["bgr-for-rgb", "one-frame-early"]),
    ];
    for convention in ["unity", "unity,wxyz", "unreal", "opencv"] {
        let named = named_in(convention, &PLANTS.map(|(bugs, _)| bugs));
        for ((report, what), (bugs, expected)) in named.iter().zip(PLANTS) {
            expect(report, expected, what);
            let said = &report.explanations[0];
            match bugs {
                ["sh-basis-sign-while"] => {
                    assert_eq!(
                        said["coefficients"],
                        serde_json::json!([1, 3, 5, 7, 9, 11, 13, 15]),
                        "{what}"
                    );
                }
                ["gram-schmidt"] => assert_eq!(said["axes"], "x, then y", "{what}"),
                ["gram-schmidt-z-first"] => assert_eq!(said["axes"], "z, then y", "{what}"),
                ["joints-xyzw"] => {
                    assert_eq!(said["in_axes_of"], report.convention.split(',').next().unwrap())
                }
                _ => {}
            }
        }
        let right = named_in(convention, &[&[]]);
        assert_eq!(right[0].0.verdict, Verdict::Conforms, "{}", right[0].0.text());
    }
}

#[test]
fn what_is_not_normalised_is_named_in_what_is_made_of_it() {
    let outs = skin(&bench().inputs, &["not-normalised-anywhere"]);
    let fields = ["means", "quaternions", "covariances", "directions"];
    let report = of_text(json_of(&outs, &fields)).unwrap();
    expect(&report, &["not-normalised"], "everywhere");
    let wrong = serde_json::json!(["quaternions", "covariances", "directions"]);
    assert_eq!(report.explanations[0]["fields"], wrong);
}

#[test]
fn bands_turned_backwards_and_not_are_two_bugs() {
    let report = of_json(&skin(&bench().inputs, &["sh-backwards-and-not"]));
    expect(&report, &["sh-not-turned", "sh-turned-backwards"], "bands");
    assert_eq!(report.alternatives, 1, "{}", report.text());
    // What another bug makes of the sums of weights is not said of fields that agree without it.
    let report = of_json(&skin(&bench().inputs, &["mirrored-shape", "weights-eleven-tenths"]));
    let sums = report.explanations.iter().find(|e| e["kind"] == "weights-not-normalised").unwrap();
    assert_eq!(sums["fields"], serde_json::json!(["means", "directions"]), "{}", report.text());
}

#[test]
fn half_floats_are_told_from_bugs() {
    let right = halved(&skin(&bench().inputs, &[]));
    for report in [of_json(&right), of_text(binary(&right, "")).unwrap()] {
        expect(&report, &["half-precision"], "half");
        let said = &report.explanations[0];
        assert!((said["read"].as_f64().unwrap() - said["expected"].as_f64().unwrap()).abs() < 1e-3, "{said}");
    }
    let wrong = halved(&skin(&bench().inputs, &["gram-schmidt"]));
    expect(&of_json(&wrong), &["gram-schmidt", "half-precision"], "half and more");
    // Rounded to something else.
    let mut coarse = skin(&bench().inputs, &[]);
    coarse.iter_mut().flatten().for_each(|o| o.mean = o.mean.map(|v| (v * 1000.0).round() / 1000.0));
    expect(&of_json(&coarse), &["unknown"], "millimetres");
}

#[test]
fn power_steps_say_how_far_off_they_are() {
    let report = of_json(&skin(&bench().inputs, &["power-15"]));
    expect(&report, &["too-few-power-steps"], "the paper's");
    let degrees = report.explanations[0]["degrees_off"].as_f64().unwrap();
    assert!((0.1..2.0).contains(&degrees) && report.text().contains("paper"), "{}", report.text());
}

/// Which pose is meant is obeyed where the answer does not say, and refused where it says otherwise.
#[test]
fn a_pose_that_is_named_is_obeyed_or_refused() {
    let outs = skin(&bench().inputs, &[]);
    let one = vec![outs[3].clone()];
    let file = tempfile::NamedTempFile::new().unwrap();
    let with = |bytes: Vec<u8>, frame: usize| {
        std::fs::write(file.path(), bytes).unwrap();
        let options = Options { frame: Some(frame), ..Options::default() };
        check(bench().folder.path(), file.path(), &options)
    };
    let said = json_of(&one, &FIELDS).replacen('{', "{\"frame\": 3,", 1);
    for bytes in [json_of(&one, &FIELDS).into_bytes(), binary(&one, "")] {
        assert_eq!(with(bytes.clone(), 3).unwrap().verdict, Verdict::Conforms);
        let report = with(bytes, 2).unwrap();
        assert_eq!((report.verdict, report.poses), (Verdict::Differs, vec![2]));
    }
    assert_eq!(with(said.clone().into_bytes(), 3).unwrap().verdict, Verdict::Conforms);
    for bytes in [said.into_bytes(), json_of(&outs, &FIELDS).into_bytes(), binary(&outs, "")] {
        let error = with(bytes, 2).map(|report| report.text()).unwrap_err().to_string();
        assert!(error.contains("--frame: 2") && error.contains("itself") && !error.contains('\n'), "{error}");
    }
    let options = Options { frame: Some(2), ..Options::default() };
    let expected = bench().folder.path().join("expected");
    let error = check(bench().folder.path(), &expected, &options).unwrap_err().to_string();
    assert!(error.contains("--frame: 2") && error.contains("6 PLY files"), "{error}");
}

#[test]
fn infinite_numbers_of_a_ply_are_refused() {
    for (what, parts) in [("scale", ["scale_0", "-inf"]), ("opacity", ["opacity", "inf"])] {
        let mut outs = skin(&bench().inputs, &[]);
        match what {
            "scale" => outs[1][7].scale[0] = 0.0,
            _ => outs[1][7].opacity = 1.0,
        }
        let folder = tempfile::tempdir().unwrap();
        ply(&outs, folder.path(), &[]);
        let error = judged(folder.path().to_owned()).map(|report| report.text()).unwrap_err().to_string();
        assert!(
            parts.iter().all(|part| error.contains(part)) && error.contains("001.ply: vertex 7"),
            "{error}"
        );
        assert!(!error.contains('\n'), "{error}");
    }
}

#[test]
fn a_bug_in_one_field_is_named_there() {
    let (right, wrong) = (skin(&bench().inputs, &[]), skin(&bench().inputs, &["posed-conjugated"]));
    let mut mixed = right.clone();
    for (mixed, wrong) in mixed.iter_mut().flatten().zip(wrong.iter().flatten()) {
        mixed.quat = wrong.quat;
    }
    let report = of_json(&mixed);
    assert_eq!(report.explanations[0]["fields"], serde_json::json!(["quaternions"]));
    assert!(report.kinds().contains(&"conjugated"), "{}", report.text());
}

#[test]
fn what_nobody_knows_is_unknown() {
    let mut outs = skin(&bench().inputs, &[]);
    outs[2][17].mean[1] += 0.25;
    outs[4][5].mean[0] -= 0.125;
    let report = of_json(&outs);
    expect(&report, &["unknown"], "two moved");
    let worst = &report.explanations[0]["worst"];
    assert_eq!((worst[0]["index"].as_u64(), worst[0]["pose"].as_u64()), (Some(17), Some(2)));
    assert_eq!((worst[1]["index"].as_u64(), worst[1]["field"].as_str()), (Some(5), Some("means")));
    assert!((worst[0]["error"].as_f64().unwrap() - 0.25).abs() < 1e-9);
    // Known where it is known.
    let mut outs = skin(&bench().inputs, &["sh-not-turned"]);
    outs[2][17].mean[1] += 0.25;
    expect(&of_json(&outs), &["sh-not-turned", "unknown"], "one moved");
}

#[test]
fn another_convention_and_its_orders() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["gltf", "unity", "unreal", "opencv", "unity,wxyz,row"] {
        let convention: Convention = name.parse().unwrap();
        export(folder.path(), Cases::Small, &convention).unwrap();
        for file in ["vectors.json", "vectors.bin"] {
            let path = folder.path().join(file);
            let report = check(folder.path(), &path, &Options::default()).unwrap();
            assert_eq!(report.verdict, Verdict::Conforms, "{name} {file}: {}", report.text());
            let options = Options { convention: Some("skinsplat".parse().unwrap()), ..Options::default() };
            let error = check(folder.path(), &path, &options).unwrap_err().to_string();
            assert!(error.contains("convention") && error.contains("as declared"), "{error}");
        }
        // PLYs are in one convention, whatever that of the vectors.
        for file in ["expected", "expected/pose_0003.ply"] {
            let report = check(folder.path(), &folder.path().join(file), &Options::default()).unwrap();
            assert_eq!(report.verdict, Verdict::Conforms, "{name} {file}: {}", report.text());
            let options = Options { convention: Some(convention), ..Options::default() };
            let declared = check(folder.path(), &folder.path().join(file), &options);
            let same = convention.map == Convention::default().map;
            assert_eq!(declared.is_ok(), same, "{name} {file}");
        }
        // Numbers that say nothing of their convention, declared as what they are not.
        let bare = folder.path().join("bare.json");
        std::fs::write(&bare, json_of(&skin(&bench().inputs, &[]), &FIELDS)).unwrap();
        let error = check(folder.path(), &bare, &Options::default()).unwrap_err().to_string();
        assert!(error.contains("skinsplat") && error.contains("as declared"), "{error}");
    }
}

#[test]
fn bad_answers_are_one_line() {
    let outs = skin(&bench().inputs, &[]);
    let text = json_of(&outs, &FIELDS);
    let fewer: Outs = outs.iter().map(|pose| pose[1..].to_vec()).collect();
    let mut swapped = outs.clone();
    swapped.iter_mut().for_each(|pose| pose.swap(3, 20));
    let whole = binary(&outs, "");
    let mut half = whole.clone();
    half[40 + 24] = 4;
    let mut halved = whole.clone();
    let bytes = (outs.len() * outs[0].len() * 3 * 2) as u64;
    halved[40 + 56..40 + 64].copy_from_slice(&bytes.to_le_bytes());
    let null = {
        let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
        value["means"][1][2][0] = serde_json::Value::Null;
        value.to_string()
    };
    let mut flagged = whole.clone();
    flagged[32] = 1;
    let twice = {
        let mut bytes = whole.clone();
        bytes.copy_within(40..40 + 64, 40 + 64);
        bytes
    };
    let more = [whole.as_slice(), &[0; 8]].concat();
    let report = of_text(more).unwrap();
    assert!(
        report.notes.iter().any(|note| note.contains("8 byte(s) after the last block")),
        "{:?}",
        report.notes
    );
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("empty", Vec::new(), &["an empty file", "PLY"]),
        ("flagged", flagged, &["quaternions xyzw", "wxyz, as declared"]),
        ("a block twice", twice, &["means: given twice", "one block"]),
        (
            "a name twice",
            text.replacen('{', "{\"means\": [],", 1).into(),
            &["means: given twice", "every name once"],
        ),
        (
            "frame and frames",
            text.replacen('{', "{\"frame\": 3, \"frames\": [3],", 1).into(),
            &["frame: 3, beside `frames`", "one of"],
        ),
        ("fewer", json_of(&fewer, &FIELDS).into(), &["53 Gaussians", "54 Gaussians"]),
        ("swapped", json_of(&swapped, &FIELDS).into(), &["order", "Gaussian 20", "2 of 54"]),
        ("a pose short", json_of(&outs[1..].to_vec(), &FIELDS).into(), &["5 poses", "6 poses"]),
        ("null", null.into(), &["means[1][2][0]", "null", "finite"]),
        ("NaN", text.replacen("0.", "NaN, 0.", 1).into(), &["JSON", "NaN"]),
        ("no field", b"{}".to_vec(), &["no field", "means"]),
        ("truncated", whole[..whole.len() - 7].to_vec(), &["truncated", "sh"]),
        ("half floats", half, &["type 4", "half floats"]),
        ("halved", halved, &["half floats", "means"]),
        ("text", b"hello".to_vec(), &["unknown format", "PLY"]),
        ("another convention", binary(&outs, "unity"), &["unity", "skinsplat", "as declared"]),
        (
            "unknown convention",
            text.replacen('{', "{\"convention\": \"blender\",", 1).into(),
            &["convention: `blender`", "unity"],
        ),
        (
            "a pose too far",
            text.replacen('{', "{\"frames\": [0,1,2,3,4,9],", 1).into(),
            &["pose 9", "below 6"],
        ),
    ];
    for (what, bytes, parts) in cases {
        let error = of_text(bytes).map(|report| report.text()).unwrap_err().to_string();
        assert!(!error.contains('\n'), "{what}: {error}");
        for part in parts {
            assert!(error.contains(part), "{what}: `{part}` in {error}");
        }
    }
}

/// Another order is seen where means are wrong too, by what no pose changes; and is not seen where there is none.
#[test]
fn another_order_is_seen_beside_other_bugs() {
    for bug in ["row-major-matrices", "bind-pose-missing", "one-frame-late", "scale-ball"] {
        let mut outs = skin(&bench().inputs, &[bug, "bind-pose-missing"]);
        outs.iter_mut().for_each(|pose| pose.reverse());
        for answer in [json_of(&outs, &FIELDS), json_of(&outs, &["means", "quaternions", "sh"])] {
            let error = of_text(answer).map(|report| report.text()).unwrap_err().to_string();
            assert!(error.contains("place 0 holds Gaussian 53, and 54 of 54"), "{bug}: {error}");
        }
    }
    // Opacities of two Gaussians swapped: everything else says that the order is right.
    let mut outs = skin(&bench().inputs, &["bind-pose-missing"]);
    for pose in &mut outs {
        (pose[3].opacity, pose[20].opacity) = (pose[20].opacity, pose[3].opacity);
    }
    expect(&of_json(&outs), &["bind-pose-missing", "unknown"], "swapped opacities");
}

/// As many numbers in another order, of other extents or of no covariance.
#[test]
fn arrays_of_another_shape_are_refused() {
    let outs = skin(&bench().inputs, &[]);
    let (poses, gaussians) = (outs.len(), outs[0].len());
    let mean = |pose: usize, i: usize| serde_json::json!(outs[pose][i].mean);
    let nested = |outer: usize, inner: usize, at: &dyn Fn(usize, usize) -> serde_json::Value| {
        (0..outer).map(|a| (0..inner).map(|b| at(a, b)).collect()).collect::<Vec<Vec<_>>>()
    };
    let full = |upper: [f64; 6]| {
        let [xx, xy, xz, yy, yz, zz] = upper;
        serde_json::json!([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    };
    let right = serde_json::json!({
        "means": nested(poses, gaussians, &mean).concat().iter().flat_map(|v| v.as_array().unwrap().clone()).collect::<Vec<_>>(),
        "covariances": nested(poses, gaussians, &|pose, i| full(outs[pose][i].covariance)),
        "opacities": nested(poses, gaussians, &|pose, i| serde_json::json!([outs[pose][i].opacity])),
    });
    assert_eq!(of_text(right.to_string()).unwrap().verdict, Verdict::Conforms);
    let alone =
        serde_json::json!({ "frame": 2, "means": outs[2].iter().map(|o| o.mean).collect::<Vec<_>>() });
    assert_eq!(of_text(alone.to_string()).unwrap().verdict, Verdict::Conforms);
    let turned = serde_json::json!({ "means": nested(gaussians, poses, &|i, pose| mean(pose, i)) });
    let mut ragged = serde_json::json!({ "means": nested(poses, gaussians, &mean) });
    let moved = ragged["means"][1][3].as_array_mut().unwrap().pop().unwrap();
    ragged["means"][1][4].as_array_mut().unwrap().push(moved);
    let mut one_sided = right.clone();
    one_sided["covariances"][1][3][0][2] = serde_json::json!(0.5);
    for (what, answer, parts) in [
        ("Gaussian by Gaussian", turned, ["means", "54 x 6 x 3", "6 x 54 x 3"]),
        ("ragged", ragged, ["means[1][3]", "a list of 2", "a list of 3"]),
        ("one-sided", one_sided, ["covariances[1][3]", "0.5", "symmetric"]),
    ] {
        let error = of_text(answer.to_string()).map(|report| report.text()).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)) && !error.contains('\n'), "{what}: {error}");
    }
    // Flat binary says its extents too: the first block is means.
    let mut bytes = binary(&outs, "");
    bytes[40 + 32..40 + 36].copy_from_slice(&(gaussians as u32).to_le_bytes());
    bytes[40 + 36..40 + 40].copy_from_slice(&(poses as u32).to_le_bytes());
    let error = of_text(bytes).map(|report| report.text()).unwrap_err().to_string();
    assert!(error.contains("54 x 6 x 3"), "{error}");
}

#[test]
fn folders_that_hold_no_rig_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let answer = bench().folder.path().join("vectors.json");
    let refused = || check(folder.path(), &answer, &Options::default()).unwrap_err().to_string();
    assert!(refused().contains("conform.json"));
    let manifest = std::fs::read_to_string(bench().folder.path().join("conform.json")).unwrap();
    std::fs::write(folder.path().join("conform.json"), manifest.replace("small", "huge")).unwrap();
    assert!(refused().contains("`huge`"));
    let newer = manifest.replace("\"rig_version\": 1", "\"rig_version\": 7");
    std::fs::write(folder.path().join("conform.json"), newer).unwrap();
    assert!(refused().contains("rig_version: 7"));
}
