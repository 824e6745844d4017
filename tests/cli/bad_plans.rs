//! Experiments, registries and folders of data that are wrong.

use crate::args;
use crate::program::{Answer, Desk};
use crate::support::data;

const TINY: &str = include_str!("tiny.toml");

fn run(desk: &Desk, more: &[&str]) -> Answer {
    let mut arguments = args!["run", "tiny.toml", "--out", "run", "--limit", "1"];
    arguments.extend(more.iter().map(std::ffi::OsString::from));
    desk.run(arguments)
}

#[test]
fn experiments_that_are_wrong() {
    let desk = Desk::new();
    for (from, to, parts) in [
        ("schema = 1", "schema = 9", vec!["schema", "9"]),
        ("schema = 1\n", "", vec!["schema"]),
        ("version = 1", "version = 1\ncolour = 2", vec!["tiny.toml:4", "colour"]),
        ("id = \"tiny\"", "id = \"other\"", vec!["id", "other"]),
        ("id = \"lbs\"", "id = \"lbs\"\nid = \"lbs\"", vec!["duplicate"]),
        ("protocol = \"avatar-v1\"", "protocol = \"mine\"", vec!["protocol", "mine", "avatar-v1"]),
        (
            "strategy = \"lbs\"",
            "strategy = \"guess\"",
            vec!["variants[0].strategy", "guess", "quaternion-average"],
        ),
        ("strategy = \"lbs\"\n", "", vec!["variants[0].strategy", "missing"]),
        ("sh_degree = 1", "sh_degree = 7", vec!["variants[0].sh_degree", "7", "0 to 3"]),
        ("sh_degree = 1", "sh_degree = \"high\"", vec!["high"]),
        ("recipe = \"surface-vertex\"", "recipe = \"magic\"", vec!["magic", "surface-vertex"]),
        ("metric = \"ssim\"", "metric = \"beauty\"", vec!["beauty", "ssim"]),
        ("metric = \"ssim\"", "metric = \"psnr\"", vec!["columns.metric", "psnr", "twice"]),
        ("baseline = \"lbs\"", "baseline = \"hugs\"", vec!["baseline", "hugs"]),
        ("layout = \"rows\"", "layout = \"spiral\"", vec!["layout", "spiral"]),
        ("decimals = 3", "decimals = 99", vec!["columns[0].decimals", "99", "at most 12"]),
        ("title = \"Table 7\"", "title = Table 7", vec!["tiny.toml:4"]),
    ] {
        let text = TINY.replacen(from, to, 1);
        assert_ne!(text, TINY, "{from}");
        desk.put("tiny.toml", text);
        let before = desk.contents();
        let mut all = vec!["tiny.toml"];
        all.extend(parts);
        run(&desk, &[]).refuses(&all, to);
        assert!(desk.contents() == before, "{to}: files changed");
    }
    desk.put("tiny.toml", [0xFF, 0xFE]);
    run(&desk, &[]).refuses(&["tiny.toml"], "not UTF-8");
    desk.put("tiny.toml", "");
    run(&desk, &[]).refuses(&["tiny.toml"], "empty");
    desk.run(args!["run", "table9", "--out", "run"]).refuses(&["table9", "table1", "table6"], "unknown");
    desk.run(args!["run", "nothing.toml", "--out", "run"])
        .refuses(&["nothing.toml", "No such file"], "missing");
    desk.put("tiny.toml", TINY);
    run(&desk, &["--subject", "nobody"]).refuses(&["subjects", "nobody", "snapshot_ava"], "subject");
    run(&desk, &["--variant", "nothing"]).refuses(&["variants", "nothing", "skinned"], "variant");
    desk.run(args!["run", "tiny.toml", "tiny.toml", "--out", "run"]).refuses(&["tiny", "twice"], "twice");
    assert!(!desk.path("run").exists());
}

#[test]
fn registries_that_are_wrong() {
    let desk = Desk::new();
    desk.put("tiny.toml", TINY);
    let folder = data("blender/datasets/snapshot_ava");
    let good = format!(
        "[[dataset]]\nid = \"snapshot_ava\"\ntitle = \"Ava\"\nlayout = \"folder\"\ncapture = \"monocular\"\n\
         licence = \"CC0-1.0\"\nprovenance = \"here\"\npath = '{}'\n",
        folder.display()
    );
    desk.put("sets.toml", &good);
    let listed = desk.ok(args!["list", "datasets", "--datasets", "sets.toml"]);
    let words: Vec<&str> = listed.split_whitespace().collect();
    assert!(words.windows(3).any(|words| words == ["Ava", "CC0-1.0", "available"]), "{listed}");
    for (text, parts, what) in [
        (good.replace("title", "colour"), vec!["line 3", "colour"], "unknown key"),
        (good.replace("layout = \"folder\"", "layout = \"heap\""), vec!["line 4", "heap"], "unknown layout"),
        (good.replace("capture = \"monocular\"", "capture = 3"), vec!["line 5"], "a number"),
        (good.repeat(2), vec!["dataset[1].id", "snapshot_ava"], "one id twice"),
        (good.replace("licence", "# licence"), vec!["licence"], "missing key"),
        ("dataset = 1".to_owned(), vec!["line 1"], "no table"),
        ("[[dataset]".to_owned(), vec!["line 1"], "not TOML"),
        (format!("{good}subjects = [\"../ava\"]\n"), vec!["dataset[0].subjects"], "a path as a name"),
        (
            good.replace("layout = \"folder\"", "layout = \"neuman\""),
            vec!["cameras.txt", "COLMAP"],
            "another layout",
        ),
    ] {
        desk.put("sets.toml", text);
        let before = desk.contents();
        run(&desk, &["--datasets", "sets.toml"]).refuses(&parts, what);
        assert!(desk.contents() == before, "{what}: files changed");
    }
    desk.put("sets.toml", format!("{good}[dataset.parameters]\nbones = 4\n"));
    run(&desk, &["--datasets", "nothing.toml"]).refuses(&["nothing.toml"], "missing");
}

#[test]
fn folders_of_data_that_are_wrong() {
    let desk = Desk::new();
    desk.put("tiny.toml", TINY);
    desk.put("empty/readme.txt", "nothing here");
    run(&desk, &["--data", "nowhere"]).refuses(&["nowhere"], "missing");
    run(&desk, &["--data", "empty"]).refuses(&["empty", "subjects"], "no subject");
    run(&desk, &["--data", "tiny.toml"]).refuses(&["tiny.toml"], "a file");
    assert!(!desk.path("run").exists());
}
