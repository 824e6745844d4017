//! `compare`: exit codes, formats, files, tolerances, pictures.

use crate::args;
use crate::program::{Desk, Kept};
use crate::reports;
use crate::schema::violation;
use serde_json::Value;
use std::sync::LazyLock;

/// Two runs: `run`, with pictures, and `worse.json` whose second variant lost 0.25 dB.
fn finished() -> Desk {
    static RUNS: LazyLock<Kept> = LazyLock::new(|| {
        let desk = reports::finished();
        desk.ok(args!["run", "tiny.toml", "--out", "run", "--limit", "1", "--images", "-q"]);
        desk.put("worse.json", changed(&desk, |results| shift(results, -0.25)).to_string());
        desk.kept()
    });
    RUNS.desk()
}

fn changed(desk: &Desk, change: impl Fn(&mut Value)) -> Value {
    let mut results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    change(&mut results);
    results
}

/// Moves the PSNR of the second variant and of its frame.
fn shift(results: &mut Value, by: f64) {
    for place in ["summary/values", "frames/0/score/values"] {
        let place = format!("/tables/0/sequences/0/variants/1/{place}/psnr");
        let psnr = results.pointer_mut(&place).unwrap();
        *psnr = Value::from(psnr.as_f64().unwrap() + by);
    }
}

#[test]
fn exit_codes_formats_and_files() {
    let desk = finished();
    let same = desk.run(args!["compare", "run", "run"]).exits(0, "itself");
    assert!(same.out.starts_with("verdict: unchanged"), "{}", same.out);

    let save = ["markdown=c.md", "junit=c.xml", "csv=c.csv", "json=c.json", "github=c.txt"];
    let mut arguments = args!["compare", "run", "worse.json"];
    arguments.extend(save.iter().flat_map(|file| args!["--save", *file]));
    let worse = desk.run(arguments).exits(1, "0.25 dB less");
    assert!(worse.out.contains("regressed") && worse.out.contains("tiny"), "{}", worse.out);
    assert!(desk.read("c.md").starts_with("# Comparison: regressed\n"));
    assert!(desk.read("c.xml").contains("failures=\"1\""), "{}", desk.read("c.xml"));
    assert!(desk.read("c.csv").lines().nth(1).unwrap().contains("regressed"), "{}", desk.read("c.csv"));
    assert!(desk.read("c.txt").starts_with("::error title=tiny regressed::"), "{}", desk.read("c.txt"));
    for (format, file) in [("markdown", "c.md"), ("junit", "c.xml"), ("csv", "c.csv"), ("json", "c.json")] {
        let printed = desk.run(args!["compare", "run", "worse.json", "--format", format]).exits(1, format);
        assert_eq!(printed.out, desk.read(file), "{format}");
    }
    let schema: Value = serde_json::from_str(include_str!("../../reports/schema/compare.json")).unwrap();
    let json: Value = serde_json::from_str(&desk.read("c.json")).unwrap();
    assert_eq!(violation(&schema, &json), None);
    assert_eq!(json["verdict"], "regressed");
    let mut odd = json.clone();
    odd["lines"][0]["fate"] = Value::from("odd");
    assert!(violation(&schema, &odd).unwrap().contains("lines[0].fate"), "the schema refuses something");

    desk.put("better.json", changed(&desk, |results| shift(results, 0.25)).to_string());
    desk.run(args!["compare", "run", "better.json"]).exits(0, "0.25 dB more");
    desk.run(args!["compare", "run", "better.json", "--strict"]).exits(1, "0.25 dB more, strictly");
    desk.put(
        "other.json",
        changed(&desk, |r| r["tables"][0]["experiment"] = Value::from("other")).to_string(),
    );
    let nothing = desk.run(args!["compare", "run", "other.json"]).exits(3, "nothing in common");
    assert!(nothing.out.contains("note: nothing with scores in common"), "{}", nothing.out);
    let cut = |r: &mut Value| r["tables"][0]["sequences"][0]["variants"].as_array_mut().unwrap().truncate(1);
    desk.put("less.json", changed(&desk, cut).to_string());
    desk.run(args!["compare", "run", "less.json"]).exits(3, "a variant less");
    desk.run(args!["compare", "less.json", "run"]).exits(0, "a variant more");
    desk.run(args!["report", "worse.json", "--baseline", "run"]).exits(1, "the alias");
}

#[test]
fn tolerances_come_from_options_files_and_metrics() {
    let desk = finished();
    desk.put("wide.toml", "psnr = 0.3\n");
    desk.put("table.toml", "psnr = 0.1\n[tables.tiny]\npsnr = 0.3\n");
    desk.put("bad.toml", "psnr = -1\n");
    let with = |more: &[&str]| {
        let mut arguments = args!["compare", "run", "worse.json"];
        arguments.extend(more.iter().map(std::ffi::OsString::from));
        desk.run(arguments)
    };
    with(&["--tolerances", "wide.toml"]).exits(0, "the file's");
    with(&["--tolerances", "table.toml"]).exits(0, "the table's");
    with(&["--tolerances", "wide.toml", "--tolerance-psnr", "0.1"]).exits(1, "the option goes first");
    with(&["--tolerance-psnr", "inf"]).exits(0, "whatever it is");
    with(&["--tolerances", "bad.toml"]).refuses(&["bad.toml", "psnr: -1"], "below zero");
    with(&["--tolerances", "none.toml"]).refuses(&["none.toml"], "no file");
    for bad in ["nan", "-0.1", "much", "1e400", ""] {
        with(&[&format!("--tolerance-psnr={bad}")]).refuses(&["--tolerance-psnr"], bad);
    }
}

#[test]
fn pictures_that_both_runs_kept_are_named() {
    let desk = finished();
    crate::program::copy(&desk.path("run"), &desk.path("now"));
    desk.put("now/results.json", desk.bytes("worse.json"));
    let out = desk.run(args!["compare", "run", "now", "--format", "json"]).exits(1, "worse").out;
    let json: Value = serde_json::from_str(&out).unwrap();
    let pictures = json["frames"][0]["pictures"].as_array().unwrap();
    assert!(pictures.iter().all(|path| desk.path(path.as_str().unwrap()).is_file()), "{pictures:?}");
    assert!(pictures[0].as_str().unwrap().starts_with("run/pictures/"), "{pictures:?}");
    for folder in ["run/images", "run/pictures"] {
        std::fs::remove_dir_all(desk.path(folder)).unwrap();
    }
    let out = desk.run(args!["compare", "run", "now", "--format", "json"]).exits(1, "worse").out;
    assert!(!out.contains("pictures"), "one of the runs has none");
}

fn kept_gif(desk: &Desk) -> std::path::PathBuf {
    let kept = crate::program::contents(&desk.path("run/pictures"));
    kept.into_iter().map(|(path, _)| path).find(|path| path.extension().is_some_and(|e| e == "gif")).unwrap()
}

/// A page shows the pictures that are there.
#[test]
fn a_page_goes_on_without_a_picture_that_is_gone() {
    let desk = finished();
    let whole = desk.ok(args!["report", "run", "--format", "html"]);
    let kept = crate::program::contents(&desk.path("run/pictures"));
    let is_png = |path: &std::path::PathBuf| path.extension().is_some_and(|e| e == "png");
    let picture = kept.into_iter().map(|(path, _)| path).find(is_png).unwrap();
    std::fs::write(&picture, "cut off").unwrap();
    let told = desk.run(args!["report", "run", "--format", "html"]).exits(0, "the others are there");
    assert!(told.out.contains("<html") && told.out.len() < whole.len());
    let name = picture.file_name().unwrap().to_string_lossy().into_owned();
    assert!(told.err.contains(&name) && told.err.contains("not shown"), "{}", told.err);
    assert!(told.err.matches("expected").count() <= 1, "{}", told.err);
    assert!(told.out.contains("could not be read and are not shown: <code>"), "the page says which");
    assert!(!told.out.contains("to keep the page small"));
}

/// Files beside the results that are no such files, or not there.
#[test]
fn a_page_says_what_it_was_made_without() {
    let desk = finished();
    desk.ok(args!["run", "tiny.toml", "--out", "run", "--limit", "2", "--images", "-q"]);
    let whole = desk.ok(args!["report", "run", "--format", "html"]);
    let gif = kept_gif(&desk);
    let bytes = std::fs::read(&gif).unwrap();
    std::fs::write(&gif, &bytes[..bytes.len() / 2]).unwrap();
    let told = desk.run(args!["report", "run", "--format", "html"]).exits(0, "the others are there");
    let gifs = |page: &str| page.matches("data:image/gif;base64,").count();
    assert_eq!(gifs(&told.out) + 1, gifs(&whole), "half of a GIF");
    assert!(told.out.contains(&*gif.file_name().unwrap().to_string_lossy()), "the page says which");
    std::fs::remove_file(desk.path("run/frames.jsonl")).unwrap();
    desk.put("run/curves.csv", "garbage");
    let page = || desk.run(args!["report", "run", "--format", "html"]);
    page().refuses(&["curves.csv", "not the CSV that was expected"], "garbage");
    std::fs::remove_file(desk.path("run/curves.csv")).unwrap();
    assert!(
        page()
            .exits(0, "without records")
            .out
            .contains("Not beside the results: <code>frames.jsonl</code> (bytes")
    );
}

#[test]
fn what_cannot_be_compared_is_refused_in_one_line() {
    let desk = finished();
    desk.put("begun/frames.jsonl", "");
    desk.put("f.toml", "[frames]\npsnr = 1\n");
    desk.run(args!["report", "begun"]).refuses(&["results.json", "not there yet"], "a run that is not done");
    for (arguments, parts) in [
        (args!["compare", "run"], ["one run", "expected two"]),
        (args!["compare", "run", "run", "--against-paper"], ["--against-paper", "expected one"]),
        (args!["compare", "run", "nowhere"], ["nowhere", "cannot read"]),
        (args!["compare", "run", "run", "--table", "table9"], ["table9", "tiny"]),
        (args!["compare", "run", "run", "--format", "pdf"], ["pdf", "junit"]),
        (args!["compare", "run", "run", "--save", "pdf=x"], ["pdf=x", "junit"]),
        (args!["compare", "run", "run", "--save", "csv=no/such/folder/x"], ["no/such/folder", ""]),
        (args!["compare", "run", "run", "--save", "csv=a", "--save", "json=no/such/x"], ["no/such/x", ""]),
        (args!["compare", "run", "run", "--save", "csv=a", "--save", "csv=b"], ["csv=b", "csv twice"]),
        (args!["compare", "run", "run", "--save", "csv=a", "--save", "json=./a"], ["json=./a", "file twice"]),
        (args!["compare", "run", "run", "--save", "csv=-"], ["csv=-", "expected a file"]),
        (args!["compare", "run", "--against-paper", "--tolerances", "f.toml"], ["f.toml: [frames]", "none"]),
        (args!["compare", "run", "--against-paper", "--frames", "3"], ["--against-paper", "--frames"]),
        (args!["report", "run", "--strict"], ["--baseline", "required"]),
        (args!["report", "run", "--all"], ["--baseline", "required"]),
        (args!["report", "run", "--frames", "3"], ["--baseline", "required"]),
        (args!["report", "run", "--tolerance-psnr", "3"], ["--baseline", "required"]),
        (args!["report", "run", "--tolerances", "f.toml"], ["--baseline", "required"]),
    ] {
        let shown = format!("{arguments:?}");
        desk.run(arguments).refuses(&parts, &shown);
    }
    assert!(!desk.path("a").exists(), "nothing is written before all can be");
    desk.put("old.json", changed(&desk, |r| r["schema"] = Value::from(2)).to_string());
    desk.run(args!["compare", "old.json", "run"])
        .refuses(&["old.json", "schema: 2", "3 to 4"], "an older schema");
    let paper = desk.run(args!["compare", "run", "--against-paper"]).exits(3, "no printed numbers");
    assert!(paper.out.contains("no table has printed numbers"), "{}", paper.out);
}
