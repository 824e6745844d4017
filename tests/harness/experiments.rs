//! Experiment files: the six tables against the transcription of the paper, a seventh, and what is refused.

use super::made_up::{TABLE_7, figures, fitted_table_7, options, own_data, run, table_7};
use super::support;
use skinsplat::experiment::{AvatarRecipe, Experiment, Layout, Paper, Role, Source, Variant, plan};
use skinsplat::report;
use skinsplat_data::Capture;
use skinsplat_metrics::MetricId;
use skinsplat_posing::PRESETS;
use std::path::Path;

fn transcription() -> toml::Table {
    std::fs::read_to_string(support::data("paper_tables.toml")).unwrap().parse().unwrap()
}

/// The transcription with every number as the characters that stand in the file.
fn rows_as_printed() -> Vec<toml::Table> {
    let text = std::fs::read_to_string(support::data("paper_tables.toml")).unwrap();
    let quoted: Vec<String> = text
        .lines()
        .map(|line| match line.split_once(" = ") {
            Some((key, value)) if value.starts_with(|c: char| c.is_ascii_digit()) => {
                format!("{key} = \"{value}\"")
            }
            _ => line.to_owned(),
        })
        .collect();
    let table: toml::Table = quoted.join("\n").parse().unwrap();
    table["row"].as_array().unwrap().iter().map(|row| row.as_table().unwrap().clone()).collect()
}

fn paper(experiment: &Experiment) -> &Paper {
    experiment.paper.as_ref().unwrap()
}

#[test]
fn the_experiments_load_from_the_folder_and_are_the_embedded_ones() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments");
    let loaded = Experiment::load_folder(&folder).unwrap();
    let ids: Vec<&str> = loaded.iter().map(|experiment| experiment.id.as_str()).collect();
    let own = [
        "attribution-animatable",
        "attribution-hugs",
        "attribution-ihuman",
        "attribution-splattingavatar",
        "bend",
        "budget",
        "ci",
        "demo",
        "engines",
        "lights",
        "noise",
        "parts",
        "pushforward",
        "swap",
    ];
    let tables = ["table1", "table2", "table3", "table4", "table5", "table6"];
    assert_eq!(ids, [&own[..], &tables, &["tuning"]].concat());
    let mut embedded = Experiment::embedded_all();
    embedded.sort_by(|a, b| a.id.cmp(&b.id));
    assert_eq!(loaded, embedded);
    assert_eq!(loaded[own.len()..][..tables.len()], Experiment::embedded());
}

#[test]
fn every_printed_number_is_the_transcription_s() {
    let experiments = Experiment::embedded();
    let mut counts = [0; 7];
    for row in rows_as_printed() {
        let text = |key: &str| row.get(key).and_then(|v| v.as_str());
        let number: usize = text("table").unwrap().parse().unwrap();
        let printed = &paper(&experiments[number - 1]).rows[counts[number]];
        counts[number] += 1;
        assert_eq!(Some(printed.sequence.as_str()), text("sequence"));
        assert_eq!(Some(printed.variant.as_str()), text("variant"));
        for metric in MetricId::all() {
            assert_eq!(printed.value(metric).map(|p| p.as_str()), text(metric.id()), "{row}");
        }
        let bold: Vec<&str> = printed.bold.iter().map(|metric| metric.id()).collect();
        let expected: Vec<&str> =
            row["bold"].as_array().unwrap().iter().map(|b| b.as_str().unwrap()).collect();
        assert_eq!(bold, expected, "{row}");
        assert_eq!(printed.doubt.as_deref(), text("doubt"));
        assert_eq!(printed.average, row.get("average").is_some());
    }
    assert_eq!(counts, [0, 10, 8, 8, 8, 8, 10]);
    for (experiment, count) in experiments.iter().zip(&counts[1..]) {
        assert_eq!(paper(experiment).rows.len(), *count, "{}", experiment.id);
    }
}

#[test]
fn headers_and_stock_evaluations_are_the_transcription_s() {
    let experiments = Experiment::embedded();
    for (table, experiment) in transcription()["table"].as_array().unwrap().iter().zip(&experiments) {
        let text = |key: &str| table.get(key).and_then(|v| v.as_str());
        let paper = paper(experiment);
        assert_eq!(experiment.id, format!("table{}", table["id"].as_integer().unwrap()));
        assert_eq!(experiment.title, format!("Table {}", table["id"].as_integer().unwrap()));
        assert_eq!(Some(experiment.dataset.as_str()), text("dataset"));
        assert_eq!(Some(experiment.caption.as_str()), text("caption"));
        assert_eq!(Some(paper.caption.as_str()), text("caption"));
        assert_eq!(Some(paper.section.as_str()), text("section"));
        assert_eq!(Some(paper.compared_with.as_str()), text("compared_with"));
        assert_eq!(Some(paper.confidence.as_str()), text("confidence"));
        let stock = table.as_table().unwrap().iter().filter_map(|(key, value)| {
            Some((key.strip_prefix("repo_")?.to_owned(), value.as_str().unwrap().to_owned()))
        });
        assert_eq!(paper.stock, stock.collect());
        assert_eq!(experiment.sequences, paper.sequences());
    }
}

#[test]
fn splits_are_the_transcription_s() {
    let experiments = Experiment::embedded();
    let mut seen = 0;
    for split in transcription()["split"].as_array().unwrap() {
        let mut split = split.as_table().unwrap().clone();
        let dataset = split.remove("dataset").unwrap();
        let method = split.remove("method").unwrap();
        let experiment = experiments.iter().find(|experiment| {
            let method_id = experiment.method.to_lowercase().replace(' ', "");
            dataset.as_str() == Some(&experiment.dataset) && method.as_str() == Some(&method_id)
        });
        let experiment = experiment.unwrap_or_else(|| panic!("{split}"));
        let own =
            experiment.splits.iter().find(|own| Some(own.sequence.as_str()) == split["sequence"].as_str());
        assert_eq!(toml::Table::try_from(own.unwrap()).unwrap(), split);
        for (role, key) in [(Role::Train, "n_train"), (Role::Test, "n_test")] {
            let stated = split.get(key).and_then(toml::Value::as_integer);
            assert_eq!(own.unwrap().count(role).map(|n| n as i64), stated, "{split}");
        }
        seen += 1;
    }
    assert_eq!(seen, experiments.iter().map(|experiment| experiment.splits.len()).sum::<usize>());
}

#[test]
fn the_tables_ask_what_the_paper_asks() {
    let experiments = Experiment::embedded();
    let strategies: Vec<Vec<Option<&str>>> =
        experiments.iter().map(|e| e.variants.iter().map(|v| v.strategy.as_deref()).collect()).collect();
    let per_vertex = "quaternion-average+rotation=vertex-average-closed-form";
    assert_eq!(
        strategies,
        vec![
            vec![Some("hugs-original"), Some("quaternion-average")],
            vec![Some("ihuman-original"), Some(per_vertex)],
            vec![Some("splattingavatar-original"), Some(per_vertex), Some(per_vertex)],
            vec![Some("animatable-original"), Some("quaternion-average"), Some("quaternion-average")],
            vec![Some("animatable-original"), Some("quaternion-average"), Some("quaternion-average")],
            vec![Some("face-tbn+rotation=face-haha-scaled"), None, Some("quaternion-average")],
        ]
    );
    let captures: Vec<Capture> =
        experiments.iter().map(|e| e.stand_in.as_ref().unwrap().capture.unwrap()).collect();
    let (mono, multi, hands) = (Capture::Monocular, Capture::Multiview, Capture::Hands);
    assert_eq!(captures, [mono, mono, mono, multi, mono, hands]);
    for experiment in &experiments {
        let given = experiment.columns.iter().filter(|column| !column.fitted);
        let metrics: Vec<&str> = given.map(|column| column.metric.id()).collect();
        let fitted = experiment.columns.iter().filter(|column| column.fitted).count();
        assert_eq!(fitted, if experiment.id == "table6" { 3 } else { 0 }, "{}", experiment.id);
        let splats = if experiment.id == "table3" { &["splats"][..] } else { &[] };
        assert_eq!(metrics, [&["psnr", "ssim", "lpips"], splats].concat(), "{}", experiment.id);
        assert_eq!(experiment.layout == Layout::Wide, experiment.id == "table6");
    }
    let [hybrid, mesh, _] = &experiments[5].variants[..] else { panic!("three variants") };
    assert!(matches!(&hybrid.avatar, AvatarRecipe::Fit { name, .. } if name == "haha"));
    assert_eq!(hybrid.paper.as_deref(), Some("original"));
    assert!(matches!(mesh.avatar, AvatarRecipe::TexturedMesh { .. }) && mesh.paper.is_none());
    assert_eq!(mesh.label, "Textured mesh");
    assert!(paper(&experiments[2]).row("male-4", "original").unwrap().doubt.is_some());
}

#[test]
fn all_strategies_add_a_row_each_and_nothing_twice() {
    let extended = table_7().with_all_strategies();
    let mut strategies: Vec<&str> =
        extended.variants.iter().map(|v| v.strategy.as_deref().unwrap()).collect();
    assert_eq!(strategies[..2], ["lbs", "quaternion-average"]);
    strategies.sort_unstable();
    let mut presets: Vec<&str> = PRESETS.iter().map(|preset| preset.id).collect();
    presets.sort_unstable();
    assert_eq!(strategies, presets);
    let added = &extended.variants[2];
    assert_eq!((added.id.as_str(), added.label.as_str()), ("strategy-face-tbn", "Face TBN"));
    assert_eq!((added.sh_degree, added.paper.as_deref()), (Some(1), None));
    assert_eq!(extended.with_all_strategies(), extended);
    let mesh = Experiment::embedded()[5].with_all_strategies();
    assert_eq!(mesh.variants[3].avatar, mesh.variants[2].avatar);
    for experiment in Experiment::embedded() {
        let text = toml::to_string(&experiment.with_all_strategies()).unwrap();
        Experiment::parse(&text, &format!("{}.toml", experiment.id)).unwrap();
    }
}

/// A table that no code knows, on data that no code knows: from its file to its rows.
#[test]
fn a_seventh_table_needs_a_file_and_no_code() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("table7.toml"), TABLE_7).unwrap();
    let experiments = Experiment::load_folder(folder.path()).unwrap();
    for (data, source, caption) in [
        (own_data(3), Source::Own, "Gymnasts, matrices against quaternions"),
        (figures(), Source::StandIn, "Figures in motion"),
    ] {
        let plan = plan(&experiments, &[data], &options()).unwrap();
        let results = report::results(&plan, &experiments, &run(&plan)).unwrap();
        assert_eq!(results.tables[0].source, source);
        let table = &results.tables[0].table;
        assert_eq!(table.sentences[0], caption);
        assert!(table.rows.len() >= 6 && results.missing() == 0);
        assert_eq!(skinsplat_table::csv(table).lines().count(), table.rows.len() + 1);
    }
}

#[test]
fn stand_ins_never_carry_the_data_set_s_name() {
    let experiments = Experiment::embedded();
    let plan = plan(&experiments, &[figures()], &options()).unwrap();
    let results = report::results(&plan, &experiments, &run(&plan)).unwrap();
    for (mut table, experiment) in results.tables.into_iter().zip(&experiments) {
        assert_eq!(table.source, Source::StandIn);
        table.paper = None;
        let files = skinsplat_table::FORMATS.iter().map(|format| (format.write)(&table.table));
        for text in files.chain([report::markdown(&table)]) {
            for name in [&experiment.dataset, &experiment.dataset_title] {
                assert!(!text.to_lowercase().contains(&name.to_lowercase()), "{name} in {text}");
            }
        }
        assert!(report::markdown(&table).contains("Ran on: Figures (figures), a stand-in"));
    }
}

#[test]
fn wrong_files_are_refused_by_name_and_key() {
    let cases = [
        ("schema = 1", "schema = 2", "schema: 2; expected 1"),
        ("title = \"Table 7\"", "title = 7", "table7.toml:4: integer `7`; expected text"),
        ("title = \"Table 7\"", "titel = \"x\"", "unknown field `titel`"),
        ("title = \"Table 7\"\n", "", "missing field `title`"),
        ("id = \"table7\"", "id = \"table8\"", "id: `table8` in table7.toml"),
        ("id = \"table7\"", "id = \"\"", "id: ``"),
        ("protocol = \"avatar-v1\"", "protocol = \"nonsense\"", "protocol: `nonsense`: no preset"),
        ("strategy = \"lbs\"", "", "variants[0].strategy: missing"),
        (
            "strategy = \"lbs\"",
            "strategy = \"lbz\"",
            "variants[0].strategy: unknown strategy `lbz`; expected lbs,",
        ),
        (
            "strategy = \"lbs\"",
            "strategy = \"lbs+hue=red\"",
            "variants[0].strategy: `hue=red`; expected one of the axes",
        ),
        ("sh_degree = 1", "sh_degree = 4", "variants[0].sh_degree: 4; expected 0 to 3"),
        ("sh_degree = 1", "", "variants[0].sh_degree: missing"),
        (
            "recipe = \"surface-vertex\"",
            "recipe = \"cloud\"",
            "unknown variant `cloud`; expected one of `surface-vertex`",
        ),
        ("recipe = \"surface-vertex\"", "recipe = \"surface-vertex\", size = 3", "unknown field `size`"),
        (
            "recipe = \"surface-vertex\"",
            "recipe = \"textured-mesh\", size = 64",
            "variants[0].strategy: given; expected none",
        ),
        (
            "recipe = \"surface-vertex\"",
            "recipe = \"surface-face\", per_face = 2",
            "unknown field `per_face`",
        ),
        (
            "baseline = \"matrices\"",
            "baseline = \"m\"",
            "baseline: `m`; expected the id of one of the variants",
        ),
        (
            "id = \"quaternions\"",
            "against = [\"m\"]\nid = \"quaternions\"",
            "variants[1].against: `m`; expected ids of variants",
        ),
        ("id = \"quaternions\"", "id = \"matrices\"", "variants.id: `matrices` twice"),
        ("label = \"Quaternions\"", "label = \"Matrices\"", "variants.label: `Matrices` twice"),
        ("label = \"Mean\"", "label = \"anna\"", "sequences, average.label: `anna` twice"),
        ("metric = \"ssim\"", "metric = \"psnr\"", "columns.metric: `psnr` twice"),
        ("metric = \"ssim\"", "metric = \"speed\"", "unknown variant `speed`"),
        ("decimals = 3", "decimals = 99", "columns[1].decimals: 99; expected at most 12"),
        (
            "caption = \"Figures in motion\"",
            "caption = \"like GYMNASTS\"",
            "stand_in.caption: names `gymnasts`",
        ),
        ("psnr = \"20.10\"", "psnr = 20.10", "a number `20.1`; expected text"),
        ("psnr = \"20.10\"", "psnr = \"20,10\"", "`20,10` is not a printed number"),
        (
            "{ sequence = \"bob\"",
            "{ sequence = \"eve\"",
            "paper.rows[2].sequence: `eve`; expected one of `sequences`",
        ),
        ("variant = \"q\"", "variant = \"m\"", "`anna` / `m` twice"),
        ("paper = \"m\"", "paper = \"x\"", "variants[0].paper: `x`"),
        ("bold = [\"psnr\"]", "bold = [\"speed\"]", "unknown variant `speed`"),
        ("psnr = \"20.10\"", "speed = \"20.10\"", "unknown variant `speed`; expected one of `psnr`"),
        ("layout = \"rows\"", "layout = \"round\"", "unknown variant `round`; expected `rows` or `wide`"),
    ];
    for (right, wrong, message) in cases {
        assert!(TABLE_7.contains(right), "{right}");
        let error = Experiment::parse(&TABLE_7.replacen(right, wrong, 1), "table7.toml").expect_err(wrong);
        let text = error.to_string();
        assert!(text.contains(message), "{wrong}\n  gave: {text}\n  not:  {message}");
        assert!(text.contains("table7.toml") && !text.contains('\n'), "{text}");
    }
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let error = Experiment::load(Path::new("nowhere/table9.toml")).unwrap_err().to_string();
    assert!(error.contains("nowhere/table9.toml"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.toml"), b"id = \"\xff\"").unwrap();
    let error = Experiment::load_folder(folder.path()).unwrap_err().to_string();
    assert!(error.contains("bad.toml"), "{error}");
}

#[test]
fn seeds_repeat_every_fit() {
    let seeded = fitted_table_7("seeds = [4, 7]").unwrap();
    let ids: Vec<&str> = seeded.variants.iter().map(|v| v.id.as_str()).collect();
    assert_eq!(ids, ["matrices-4", "quaternions-4", "matrices-7", "quaternions-7"]);
    assert_eq!(seeded.baseline, "matrices-4");
    let called = |id: &str| seeded.variants.iter().filter(|v| v.is_called(id)).count();
    assert_eq!([called("matrices"), called("matrices-7"), called("mat")], [2, 1, 0]);
    let seed = |v: &Variant| match v.avatar {
        AvatarRecipe::Fit { seed, .. } => seed,
        _ => panic!("{}", v.id),
    };
    assert_eq!(seeded.variants.iter().map(seed).collect::<Vec<_>>(), [4, 4, 7, 7]);
    assert_eq!(fitted_table_7("").unwrap().with_seeds(&[4, 7]).unwrap(), seeded, "given later, the same");
    let own = seeded.with_seeds(&[1]).unwrap_err().to_string();
    assert!(own.contains("seeds") && own.contains("[4, 7]"), "{own}");
    let twice = fitted_table_7("seeds = [4, 4]").unwrap_err().to_string();
    assert!(twice.contains("table7.toml") && twice.contains("each once"), "{twice}");
}
