//! `report`: formats, and the comparison with a baseline.

use crate::args;
use crate::program::{Desk, Kept};
use crate::schema::violation;
use crate::support::data;
use serde_json::Value;
use std::sync::LazyLock;

/// A desk with `tiny.toml` and its run of one frame per sequence in `run`.
pub(super) fn finished() -> Desk {
    static RUN: LazyLock<Kept> = LazyLock::new(|| {
        let desk = Desk::new();
        desk.put("tiny.toml", include_str!("tiny.toml"));
        let page = desk.ok(args!["run", "tiny.toml", "--out", "run", "--limit", "1"]);
        assert_eq!(page, desk.read("run/tables.md"));
        desk.kept()
    });
    RUN.desk()
}

#[test]
fn a_report_repeats_the_files_of_the_run() {
    let desk = finished();
    for (format, file) in [("markdown", "run/tables.md"), ("csv", "run/tiny.csv"), ("latex", "run/tiny.tex")]
    {
        assert_eq!(desk.ok(args!["report", "run", "--format", format]), desk.read(file), "{format}");
    }
    assert_eq!(desk.ok(args!["report", "run/results.json"]), desk.read("run/tables.md"));
    assert_eq!(desk.ok(args!["report", "run", "--table", "tiny"]), desk.read("run/tables.md"));
    let tables: Value = serde_json::from_str(&desk.ok(args!["report", "run", "--format", "json"])).unwrap();
    let results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    assert_eq!(tables, Value::Array(vec![results["tables"][0]["table"].clone()]));
    assert!(
        desk.read("run/tables.md").contains("Partial: at most 1 frame per sequence."),
        "a subset is marked"
    );
}

#[test]
fn a_worse_result_is_exit_code_1() {
    let desk = finished();
    let compare = |candidate: &str, more: &[&str]| {
        let mut arguments = args!["report", candidate, "--baseline", "run"];
        arguments.extend(more.iter().map(std::ffi::OsString::from));
        desk.run(arguments)
    };
    let same = compare("run", &[]).exits(0, "itself");
    assert!(same.out.contains("unchanged"), "{}", same.out);

    let mut results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    let summary = &mut results["tables"][0]["sequences"][0]["variants"][1]["summary"]["values"]["psnr"];
    let psnr = summary.as_f64().unwrap();
    *summary = Value::from(psnr - 0.25);
    desk.put("worse.json", results.to_string());
    let worse = compare("worse.json", &[]).exits(1, "0.25 dB less");
    assert!(worse.out.contains("verdict: regressed") && worse.out.contains("PSNR"), "{}", worse.out);
    compare("worse.json", &["--tolerance-psnr", "0.3"]).exits(0, "within the tolerance");
    for metric in skinsplat_metrics::METRICS {
        let option = format!("--tolerance-{}", metric.id);
        compare("run", &[&option, "0.5"]).exits(0, &option);
        compare("run", &[&option, "much"]).refuses(&[&option, "much"], "no number");
    }
    let json: Value = serde_json::from_str(&compare("worse.json", &["--format", "json"]).out).unwrap();
    assert_eq!(json["verdict"], "regressed");

    results["tables"][0]["sequences"][0]["variants"][1]["summary"]["values"]["psnr"] =
        Value::from(psnr + 0.25);
    desk.put("better.json", results.to_string());
    compare("better.json", &[]).exits(0, "0.25 dB more");

    results["tables"][0]["experiment"] = Value::from("other");
    desk.put("other.json", results.to_string());
    compare("other.json", &[]).exits(3, "nothing in common");
}

/// `report --baseline` says what `compare` says, of the tables that were asked for and in the format that was asked for.
#[test]
fn a_baseline_is_reported_as_compare_does() {
    let desk = finished();
    let mut two: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    let mut other = two["tables"][0].clone();
    other["experiment"] = Value::from("other");
    two["tables"].as_array_mut().unwrap().push(other);
    desk.put("two.json", two.to_string());
    let one = desk.run(args!["report", "two.json", "--baseline", "two.json", "--table", "tiny"]);
    let one = one.exits(0, "one table of two").out;
    assert!(one.contains("unchanged") && !one.contains("other"), "{one}");
    desk.run(args!["report", "two.json", "--baseline", "two.json", "--table", "third"])
        .refuses(&["third", "other, tiny"], "no such table");
    for format in ["text", "markdown", "csv", "latex", "json"] {
        let report =
            desk.ok(args!["report", "run", "--baseline", "two.json", "--table", "tiny", "--format", format]);
        let compare = desk.ok(args!["compare", "two.json", "run", "--table", "tiny", "--format", format]);
        assert_eq!(report, compare, "{format}");
    }
    desk.run(args!["report", "run", "--baseline", "run", "--format", "html"])
        .refuses(&["--format html", "--baseline"], "no page of what moved");
    desk.run(args!["report", "run", "--timing", "--format", "html", "--out", "t.html"])
        .refuses(&["--format html", "--timing"], "no page of times");
    desk.run(args!["report", "two.json", "--timing"])
        .refuses(&["frames.jsonl", "no recorded times"], "no times");
}

#[test]
fn an_incomplete_run_is_exit_code_3() {
    let desk = Desk::new();
    desk.put(
        "tiny.toml",
        include_str!("tiny.toml").replace("sequences = [\"snapshot_ava\"]", "sequences = [\"nobody\"]"),
    );
    let answer = desk.run(args!["run", "tiny.toml", "--out", "run"]).exits(3, "no such subject");
    assert!(answer.err.contains("no frame"), "{}", answer.err);
    assert!(desk.read("run/tables.md").contains("no subject \\`nobody\\`"));
}

/// The first item of a list again at its end.
fn twice(items: &mut Value) {
    let first = items[0].clone();
    items.as_array_mut().unwrap().push(first);
}

#[test]
fn what_is_no_result_is_named() {
    let desk = finished();
    let results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    let changed = |change: fn(&mut Value)| {
        let mut results = results.clone();
        change(&mut results);
        results.to_string()
    };
    for (content, parts) in [
        (String::new(), vec!["bad.json"]),
        ("[]".to_owned(), vec!["bad.json", "a list; expected an object", "SCHEMA.md"]),
        (changed(|r| r["schema"] = Value::from(99)), vec!["bad.json", "schema", "99"]),
        (
            changed(|r| r["tables"] = Value::from("none")),
            vec!["bad.json", "tables: text \"none\"; expected a list"],
        ),
        (changed(|r| r["extra"] = Value::from(1)), vec!["bad.json", "extra"]),
        (
            changed(|r| {
                r["tables"][0]["sequences"][0]["variants"][0]["summary"]["values"]["psnr"] =
                    Value::from("high")
            }),
            vec![
                "bad.json: tables[0].sequences[0].variants[0].summary.values.psnr: text \"high\"; expected a number",
                "SCHEMA.md",
            ],
        ),
        (
            changed(|r| {
                r["tables"][0]["sequences"][0]["variants"][1]["frames"][0]["score"]["values"]["ssim"] =
                    Value::Null
            }),
            vec!["bad.json: tables[0].sequences[0].variants[1].frames[0].score: `ssim` is null", "a number"],
        ),
        (changed(|r| twice(&mut r["tables"])), vec!["tables: experiment: `tiny` twice"]),
        (
            changed(|r| twice(&mut r["tables"][0]["sequences"])),
            vec!["sequences: id", "twice; expected each once"],
        ),
        (
            changed(|r| twice(&mut r["tables"][0]["sequences"][0]["variants"])),
            vec!["variants: id", "twice; expected each once"],
        ),
        (desk.read("run/results.json")[..400].to_owned(), vec!["bad.json", "line"]),
    ] {
        desk.put("bad.json", &content);
        let shown = content.chars().take(80).collect::<String>();
        desk.run(args!["report", "bad.json"]).refuses(&parts, &shown);
        desk.run(args!["report", "run", "--baseline", "bad.json"]).refuses(&parts, &shown);
    }
    desk.run(args!["report", "nowhere"]).refuses(&["nowhere"], "no such run");
    desk.run(args!["report", "."]).refuses(&["results.json"], "no run");
    desk.run(args!["report", "run", "--table", "table9"]).refuses(&["table9", "tiny"], "no such table");
    desk.run(args!["report", data("blender")]).refuses(&["results.json"], "a folder of data");
}

/// Metrics that no column shows are not computed, and the others keep their bits.
#[test]
fn only_metrics_with_a_column_are_computed() {
    let desk = finished();
    let tiny = desk.read("tiny.toml");
    desk.put(
        "one.toml",
        tiny.replace("id = \"tiny\"", "id = \"one\"")
            .replace("[[columns]]\nmetric = \"ssim\"\ndecimals = 4\n", ""),
    );
    let scores = |table: &str| {
        desk.ok(args!["run", table, "--limit", "1", "--out", "run"]);
        let results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
        let summary = "/tables/0/sequences/0/variants/0/summary/values";
        results.pointer(summary).unwrap_or_else(|| panic!("{summary}: {results}")).clone()
    };
    let (both, one) = (scores("tiny.toml"), scores("one.toml"));
    assert!(both["ssim"].is_number() && one["ssim"].is_null(), "{both} {one}");
    assert_eq!(both["psnr"], one["psnr"]);
}

/// What a run writes is what the published schema says, in every table shape that the built-in ones have.
#[test]
fn results_are_of_the_published_schema() {
    let schema: Value = serde_json::from_str(include_str!("../../reports/schema/results.json")).unwrap();
    let desk = finished();
    let results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    assert_eq!(violation(&schema, &results), None);
    let baseline: Value = serde_json::from_str(include_str!("../../ci/baseline.json")).unwrap();
    assert_eq!(violation(&schema, &baseline), None);
    for (place, value) in
        [("/tables/0/source", "elsewhere"), ("/tables/0/table/rows/0/kind", "odd"), ("/schema", "4")]
    {
        let mut odd = results.clone();
        *odd.pointer_mut(place).unwrap() = Value::from(value);
        assert!(violation(&schema, &odd).is_some(), "{place}");
    }
    let mut odd = results;
    odd["tables"][0]["unknown"] = Value::from(1);
    assert!(violation(&schema, &odd).unwrap().contains("unknown"));
}

/// Scores of fitted test poses have their place in the schema, in the page, and in where the time went.
#[test]
fn fitted_test_poses_are_told_wherever_scores_are() {
    let desk = Desk::new();
    let fitted = include_str!("tiny.toml")
        .replace("id = \"tiny\"", "id = \"fitted\"")
        .replace("snapshot_ava", "tiny")
        .replace("layout =", "test_poses = \"fitted\"\ntest_pose = { steps = 2 }\nlayout =");
    desk.put("fitted.toml", &fitted);
    let run = args!["run", "fitted.toml", "--data", data("small"), "--out", "run", "--limit", "1"];
    desk.ok([run, args!["--html", "page.html"]].concat());
    let schema: Value = serde_json::from_str(include_str!("../../reports/schema/results.json")).unwrap();
    let results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    assert_eq!(violation(&schema, &results), None);
    let page = desk.read("page.html");
    assert!(page.contains("PSNR (as given) over frames") && page.contains("PSNR (fitted) over frames"));
    assert!(desk.ok(args!["report", "run", "--timing"]).contains("Fit poses, s"));
    // An experiment that was written out and read again keeps its columns.
    assert_eq!(desk.ok(args!["compare", "run", "run", "--strict"]).lines().count(), 1);
}

#[test]
fn what_is_read_is_not_written_over() {
    let desk = finished();
    let tiny = desk.bytes("tiny.toml");
    let results = desk.bytes("run/results.json");
    for arguments in [
        args!["report", "run", "--format", "html", "--out", "run/results.json"],
        args!["compare", "run", "run", "--save", "json=run/frames.jsonl"],
        args!["compare", "run/results.json", "run", "--save", "markdown=run/results.json"],
        args!["run", "tiny.toml", "--limit", "1", "--out", "run", "--html", "tiny.toml"],
        args!["report", "run", "--format", "html", "--out", "run/pictures/index.json"],
        args!["report", "run/results.json", "--format", "html", "--out", "run/../run/curves.csv"],
    ] {
        desk.run(arguments).refuses(&["it is read; expected another file"], "an input as an output");
    }
    for (page, part) in [
        ("run/results.json", "it is written by this run; expected another file"),
        ("run/tables.md", "it is written by this run; expected another file"),
        ("run", "it is a folder of this run; expected a file"),
    ] {
        let run = args!["run", "tiny.toml", "--limit", "1", "--out", "run", "--html", page];
        desk.run(run).refuses(&[page, part], "an output as another");
    }
    assert_eq!((tiny, results), (desk.bytes("tiny.toml"), desk.bytes("run/results.json")));
}

/// The circumstances of a run, and where its time went.
#[test]
fn a_run_says_what_made_it_and_how_long_that_took() {
    let desk = finished();
    let run: Value = serde_json::from_str(&desk.read("run/run.json")).unwrap();
    let digest = |value: &Value| value.as_str().is_some_and(|text| text.len() == 64);
    assert!(digest(&run["binary"]), "{run}");
    let data = run["data"]["snapshot_ava/snapshot_ava/test_squat"].as_array().unwrap();
    assert!(data.len() == 2 && data.iter().all(digest), "{run}");
    assert_eq!(run["phases"]["avatars"].as_array().unwrap().len(), 1, "both variants draw one avatar");
    assert!(run["phases"]["frames"].as_f64().unwrap() > 0.0 && run["code"]["fit"].is_u64(), "{run}");
    let timing = desk.ok(args!["report", "run", "--timing"]);
    assert!(timing.contains("| avatar snapshot_ava/snapshot_ava surface-vertex |"), "{timing}");
    assert!(timing.contains("Where the time went") && timing.contains("| Skinned | "), "{timing}");
}

/// A fit says what its start, its iterations and its curve took, which is all of its time; an avatar how large it is.
#[test]
fn the_parts_of_a_fit_and_the_bytes_of_an_avatar_are_told() {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    let all =
        args!["-q", "run", "small.toml", "--data", data("small"), "--fit-iterations", "2", "--out", "run"];
    desk.ok([all.clone(), args!["--html", "page.html"]].concat());
    let run: Value = serde_json::from_str(&desk.read("run/run.json")).unwrap();
    let (avatars, fits) = (&run["phases"]["avatars"], run["phases"]["fits"].as_array().unwrap());
    let part = |i: usize, part: &str| fits[i][part].as_f64().unwrap();
    for i in 0..2 {
        let fitted = avatars[i][0].as_str().unwrap().contains("hugs-skinned");
        let sum: f64 = ["start", "iterations", "curve"].map(|name| part(i, name)).iter().sum();
        assert_eq!(sum > 0.0, fitted, "{run}");
        if fitted {
            assert!((sum - avatars[i][1].as_f64().unwrap()).abs() < 1e-9, "{run}");
            assert!(part(i, "start") > 0.0 && part(i, "iterations") > 0.0 && part(i, "curve") > 0.0, "{run}");
        }
    }
    let timing = desk.ok(args!["report", "run", "--timing"]);
    assert!(timing.contains("| all avatars |") && timing.contains("Start, s"), "{timing}");
    // A call that finds everything done keeps what is known of the fits.
    desk.ok(all);
    let again: Value = serde_json::from_str(&desk.read("run/run.json")).unwrap();
    assert_eq!(again["phases"]["fits"], run["phases"]["fits"]);
    assert_eq!(again["phases"]["avatars"], run["phases"]["avatars"]);
    // The surface avatar is one file; the start of a fit is another, and no avatar of the table.
    let kept = std::fs::read_dir(desk.path("run/avatars")).unwrap().map(|entry| entry.unwrap().path());
    let made = kept.filter(|path| path.extension().is_some_and(|kind| kind == "ply"));
    let bytes: Vec<u64> = made.map(|path| std::fs::metadata(path).unwrap().len()).collect();
    let page = desk.read("page.html");
    let records = desk.read("run/frames.jsonl");
    let known = bytes.iter().filter(|bytes| records.contains(&format!("\"bytes\":{bytes}"))).count();
    assert!(known >= 2, "{bytes:?} {records}");
    assert!(page.contains("Bytes") && page.contains("over bend"));
    assert!(page.contains("the median of 5 repeats, variants in alternating order"), "{page}");
    let costs: Value = serde_json::from_str(&desk.read("run/costs.json")).unwrap();
    let drawn = costs["variants"].as_array().unwrap();
    assert!(drawn.len() == 2 && drawn.iter().all(|cost| cost["draw"].as_f64().unwrap() > 0.0), "{costs}");
    // Those of another plan are not this run's.
    desk.put("run/costs.json", desk.read("run/costs.json").replacen("\"plan\": \"", "\"plan\": \"0", 1));
    desk.ok(args!["report", "run", "--format", "html", "--out", "again.html"]);
    assert!(desk.read("again.html").contains("Times were taken once per frame"));
}

/// One file, whose tables, charts and pictures are there, and that says what is not.
#[test]
fn a_run_is_one_page() {
    let desk = finished();
    let page = |arguments: Vec<std::ffi::OsString>| {
        desk.ok(arguments);
        desk.read("page.html")
    };
    let without = page(args!["report", "run", "--format", "html", "--out", "page.html"]);
    assert!(without.contains("Without pictures") && without.contains("Partial"), "no pictures were kept");
    assert!(without.contains("Two strategies on a turning body"));
    let with = page(args!["run", "tiny.toml", "--limit", "2", "--out", "run", "--html", "page.html", "-q"]);
    assert!(with.contains("data:image/jpeg;base64,") && with.contains("data:image/gif;base64,"));
    assert!(!with.contains("Without pictures") && with.len() < 15_000_000);
    assert_eq!(
        page(args!["report", "run", "--format", "html", "--out", "page.html"]),
        with,
        "the same from the folder"
    );
    let none = page(args!["report", "run", "--format", "html", "--images", "none", "--out", "page.html"]);
    assert!(none.len() < with.len() && !none.contains("data:image/jpeg"));
    let small = page(args!["report", "run", "--format", "html", "--page-mb", "0.1", "--out", "page.html"]);
    assert!(small.len() < with.len() && small.contains("stays below 0.1 MB"), "{}", small.len());
    for format in [&["--images", "none"][..], &["--images", "key", "--format", "csv"], &["--page-mb", "3"]] {
        let report = args!["report", "run"].into_iter().chain(format.iter().map(std::ffi::OsString::from));
        desk.run(report.collect()).refuses(&[format[0], "--format html"], "no page");
    }
    desk.run(args!["run", "tiny.toml", "--images", "some"])
        .refuses(&["some", "none, key, all"], "no such choice");
}
