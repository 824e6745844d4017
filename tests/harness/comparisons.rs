//! What moved between two results documents.

use super::made_up::{results, run, table_7, wide_table_7, with_holes};
use skinsplat::experiment::{FittedOutcome, Outcome, Plan, PoseNoise, Profile, Records, Source};
use skinsplat::report::compare::{
    Changes, Fate, Tolerances, Verdict, against_paper, compare, github, junit, markdown, text,
};
use skinsplat::report::{OLDEST_SCHEMA, Results, SCHEMA, VariantResults};
use skinsplat_metrics::MetricId;

/// Something done to results, and what is said of it.
type Edit<'e, T> = (&'e dyn Fn(&mut T), &'e str);

/// The made-up results with the PSNR of one frame of anna's quaternions moved.
fn moved(by: f64) -> Results {
    results(&table_7(), |plan| {
        let mut records = run(plan);
        let key = &plan.jobs[3].variants[1].key;
        let Outcome::Scored { score, .. } = &mut records.get_mut(key).unwrap().outcome else {
            unreachable!()
        };
        let psnr = score.value(MetricId::PSNR).unwrap();
        score.values.insert(MetricId::PSNR, psnr + by);
        records
    })
}

fn base() -> Results {
    results(&table_7(), run)
}

fn by_default(current: &Results) -> Changes {
    compare(&base(), current, &Tolerances::default())
}

#[test]
fn what_moves_by_more_than_its_tolerance_is_named_with_its_frames() {
    let same = compare(&base(), &base(), &Tolerances::none());
    assert_eq!((same.verdict, same.frames_moved, same.compared), (Verdict::Unchanged, 0, 4));
    assert_eq!(same.counts.unchanged, same.lines.len());
    let within = by_default(&moved(-0.01));
    assert_eq!((within.verdict, within.frames_moved), (Verdict::Unchanged, 1));
    assert_eq!(compare(&base(), &moved(-0.01), &Tolerances::none()).verdict, Verdict::Regressed);
    let better = by_default(&moved(0.6));
    assert_eq!((better.verdict, better.is_good()), (Verdict::Improved, true));
    assert!(!better.strictly().is_good(), "a score that rises may be a fault too");
    let worse = by_default(&moved(-0.6));
    assert_eq!((worse.verdict, worse.is_good(), worse.counts.regressed), (Verdict::Regressed, false, 1));
    let shown = text(&worse, false);
    assert!(shown.starts_with("verdict: regressed: 1 regressed, 15 unchanged\n"), "{shown}");
    let row = "table7  gymnasts/anna/anna-test  quaternions  PSNR    regressed   20.7500  20.6500  −0.1000      0.005";
    assert!(shown.contains(row) && shown.contains("image_0003"), "{shown}");
    insta::assert_snapshot!(github(&worse), @r"
    ::error title=table7 regressed::gymnasts/anna/anna-test quaternions: PSNR 20.7500 -> 20.6500 (tolerance 0.005); most in image_0003
    ::error title=reproduce compare::verdict: regressed: 1 regressed, 15 unchanged
    ");
    assert_eq!(github(&worse.clone().with_frames(0)), github(&worse), "whatever is shown elsewhere");
    let page = markdown(&worse, false);
    assert!(
        page.starts_with(
            "# Comparison: regressed\n\n1 regressed, 0 missing, 0 improved, 0 new, 15 unchanged;"
        ),
        "{page}"
    );
    let row = "| table7 | gymnasts/anna/anna-test | quaternions | PSNR | regressed | 20.7500 | 20.6500 | −0.1000 | 0.005 |";
    assert!(page.contains(row) && page.contains("<details><summary>Frames that moved most"), "{page}");
    let xml = junit(&worse);
    assert!(
        xml.contains(r#"<testsuite name="table7" tests="16" skipped="0" errors="0" failures="1">"#),
        "{xml}"
    );
    assert!(xml.contains(r#"<failure message="20.7500 -&gt; 20.6500 (tolerance 0.005)"#), "{xml}");
}

#[test]
fn a_movement_of_the_tolerance_itself_is_within_it() {
    let tolerance = |psnr: f64| Tolerances::each(|id| if id == MetricId::PSNR { psnr } else { 0.0 });
    // The mean of six frames moves by a sixth.
    assert_eq!(compare(&base(), &moved(-0.6), &tolerance(0.1)).verdict, Verdict::Unchanged);
    assert_eq!(compare(&base(), &moved(-0.6), &tolerance(0.0999)).verdict, Verdict::Regressed);
}

#[test]
fn a_single_frame_counts_where_its_own_tolerance_says_so() {
    let frames = |bound: &str| Tolerances::parse(&format!("psnr = 1\n[frames]\npsnr = {bound}")).unwrap();
    assert_eq!(compare(&base(), &moved(-0.6), &frames("0.7")).verdict, Verdict::Unchanged);
    let worse = compare(&base(), &moved(-0.6), &frames("0.5"));
    assert_eq!(worse.verdict, Verdict::Regressed);
    let line = worse.lines.iter().find(|line| line.fate == Fate::Regressed).unwrap();
    assert_eq!(
        (line.variant.as_str(), line.frames.as_slice()),
        ("quaternions", &["image_0003".to_owned()][..])
    );
    assert!(github(&worse).contains("; in image_0003\n"), "{}", github(&worse));
}

/// What is missing is not worse, and what is left is compared over the frames that both have.
/// With poses fitted to the test images a variant has two summaries, and both are looked at.
#[test]
fn scores_of_fitted_poses_are_compared_too() {
    let fitted = |by: f64| {
        let mut results = base();
        let variant = &mut results.tables[0].sequences[0].variants[0];
        let mut summary = variant.summary.clone().unwrap();
        let psnr = summary.value(MetricId::PSNR).unwrap();
        summary.values.insert(MetricId::PSNR, psnr + by);
        variant.fitted = Some(summary);
        results
    };
    let changes = compare(&fitted(1.0), &fitted(0.5), &Tolerances::default());
    assert_eq!((changes.verdict, changes.counts.regressed), (Verdict::Regressed, 1));
    assert!(text(&changes, false).contains("PSNR (fitted)"), "{}", text(&changes, false));
    // A frame more in one of them: those of both are compared, each with its fitted score.
    let more = |by: f64, frames: usize| {
        let mut results = base();
        let variant = &mut results.tables[0].sequences[0].variants[0];
        for frame in &mut variant.frames {
            let mut score = frame.score.clone().unwrap();
            let psnr = score.value(MetricId::PSNR).unwrap();
            score.values.insert(MetricId::PSNR, psnr + by);
            frame.fitted = Some(FittedOutcome::Scored { score, turned_degrees: 1.0 });
        }
        variant.frames.truncate(frames);
        results
    };
    let changes = compare(&more(1.0, 2), &more(-9.0, 3), &Tolerances::default());
    assert_eq!(changes.verdict, Verdict::Regressed, "{:?}", changes.counts);
    assert!(changes.frames.iter().any(|moved| moved.fitted && moved.worse));
    assert!(github(&changes).contains("PSNR (fitted)"), "{}", github(&changes));
    let lost = compare(&fitted(1.0), &base(), &Tolerances::default());
    assert!(lost.counts.missing > 0 && !lost.is_good(), "{:?}", lost.counts);
}

#[test]
fn lost_scores_are_missing_and_new_ones_are_no_matter() {
    let (full, holes) = (base(), results(&table_7(), with_holes));
    let wide = Tolerances::each(|_| f64::INFINITY);
    let lost = compare(&full, &holes, &wide);
    assert_eq!(lost.verdict, Verdict::Incomplete);
    let missing: Vec<(&str, &str, Option<&str>, usize)> = (lost.lines.iter())
        .filter(|line| line.fate == Fate::Missing)
        .map(|line| (&*line.sequence, &*line.variant, line.metric.map(MetricId::id), line.frames.len()))
        .collect();
    let [anna, bob] = ["gymnasts/anna/anna-test", "gymnasts/bob/bob-test"];
    assert_eq!(missing, [(anna, "matrices", None, 2), (bob, "matrices", Some("lpips"), 0)]);
    let psnr = |changes: &Changes| {
        let of = |line: &&skinsplat::report::compare::Line| {
            line.sequence == anna && line.variant == "matrices" && line.metric == Some(MetricId::PSNR)
        };
        changes.lines.iter().find(of).unwrap().clone()
    };
    let shared = psnr(&lost);
    assert_eq!((shared.fate, shared.baseline), (Fate::Unchanged, shared.current), "the same four frames");
    let gained = compare(&holes, &full, &wide);
    assert_eq!((gained.counts.missing, gained.counts.new), (0, 2));
    assert_eq!(gained.verdict, Verdict::Unchanged);
    let empty = results(&table_7(), |_: &Plan| Records::new());
    assert_eq!(compare(&empty, &full, &wide).verdict, Verdict::Incomplete, "nothing compared");
}

#[test]
fn what_does_not_compare_is_left_out_with_a_line() {
    type Change = fn(&mut Results);
    let cases: [(Change, &str); 4] = [
        (
            |r| r.tables[0].protocol.version += 1,
            "table7: protocol avatar-v1@1 in the baseline, avatar-v1@2 now: not compared",
        ),
        (|r| r.tables[0].version += 1, "table7: version of the experiment"),
        (
            |r| r.tables[0].sequences[0].data.as_mut().unwrap().test = "other".into(),
            "table7: gymnasts/anna/anna-test: other test data (images, cameras, poses or body) of the same name: not compared",
        ),
        (
            |r| r.tables[0].sequences[0].data.as_mut().unwrap().train = None,
            "table7: gymnasts/anna/anna-test: other training data of the same name: not compared",
        ),
    ];
    for (change, expected) in cases {
        let mut current = base();
        change(&mut current);
        let changes = by_default(&current);
        assert_eq!(changes.verdict, Verdict::Incomplete, "{expected}");
        assert!(
            changes.notes[0].left_out && changes.notes[0].text.starts_with(expected),
            "{:?}",
            changes.notes
        );
        assert_eq!(changes.counts.regressed + changes.counts.missing, 0);
        assert!(junit(&changes).contains("<error"), "{expected}");
    }
    let mut other = base();
    other.tables[0].experiment = "table8".into();
    let changes = by_default(&other);
    assert_eq!((changes.verdict, changes.compared), (Verdict::Incomplete, 0));
    let note = &changes.notes[0].text;
    assert_eq!(
        note,
        "nothing with scores in common: the baseline has table7, the current results have table8"
    );
}

#[test]
fn other_circumstances_are_said() {
    let mut current = base();
    current.code.render += 1;
    current.options.profile.resolution = Some(128);
    let changes = by_default(&current);
    assert_eq!(changes.verdict, Verdict::Unchanged);
    let notes: Vec<&str> = changes.notes.iter().map(|note| note.text.as_str()).collect();
    let render = base().code.render;
    assert_eq!(
        notes,
        [
            "profile: standard, 2000 iterations, edges of 10 mm in the baseline, standard, 128 pixels, 2000 iterations, edges of 10 mm \
             now"
                .to_owned(),
            format!("code version of render: {render} in the baseline, {} now", render + 1)
        ]
    );
}

/// An id may stand for something else than it did: that is said, and other noise on the poses is other data.
#[test]
fn other_ways_to_make_a_variant_are_said() {
    let mut current = base();
    for sequence in &mut current.tables[0].sequences {
        let quaternions = &mut sequence.variants[1];
        (quaternions.strategy, quaternions.takes) = (Some("lbs".to_owned()), Some(2));
    }
    let changes = compare(&base(), &current, &Tolerances::parse("[tables.table9]\npsnr = 1\n").unwrap());
    let notes: Vec<&str> = changes.notes.iter().map(|note| note.text.as_str()).collect();
    assert_eq!(
        notes,
        [
            "tolerances: [tables.table9]: neither run has this table",
            r#"table7: quaternions: strategy "quaternion-average" in the baseline, "lbs" now"#,
            "table7: quaternions: takes null in the baseline, 2 now",
        ]
    );
    assert_eq!(changes.verdict, Verdict::Unchanged, "said, and compared");
    let mut noisy = base();
    noisy.tables[0].sequences[0].variants[1].pose_noise =
        Some(PoseNoise { degrees: 2.0, seed: 0, version: 1 });
    let changes = by_default(&noisy);
    assert_eq!(changes.verdict, Verdict::Incomplete);
    assert!(
        changes.notes[0].text.ends_with("poses without noise in the baseline, pose noise of 2 degrees (seed 0, version 1) now: not compared"),
        "{:?}",
        changes.notes
    );
}

/// Frames of one name, of several cameras say, are each compared with the one in the same place.
#[test]
fn frames_of_one_name_are_told_apart() {
    let alike = |mut results: Results| {
        let of_all = results.tables.iter_mut().flat_map(|t| &mut t.sequences).flat_map(|s| &mut s.variants);
        of_all.for_each(|variant| variant.frames.iter_mut().for_each(|frame| frame.name = "0001".to_owned()));
        results
    };
    let changes = compare(&alike(base()), &alike(moved(-0.6)), &Tolerances::default());
    assert_eq!((changes.verdict, changes.frames_moved), (Verdict::Regressed, 1));
    assert_eq!(changes.frames[0].frame, "0001 (4)");
}

/// A document of the schema before has no digests of data, and is read.
#[test]
fn the_schema_before_is_read_and_earlier_ones_are_refused() {
    let mut old = base();
    old.schema = OLDEST_SCHEMA;
    old.tables[0].sequences.iter_mut().for_each(|sequence| sequence.data = None);
    let old = Results::from_json(&old.to_json()).unwrap();
    let changes = compare(&old, &base(), &Tolerances::none());
    assert_eq!(changes.verdict, Verdict::Unchanged);
    assert!(changes.notes[0].text.starts_with("baseline: schema 3 has no digests"), "{:?}", changes.notes);
    for schema in [0, OLDEST_SCHEMA - 1, SCHEMA + 1] {
        let text = Results { schema, ..base() }.to_json();
        let expected = format!("schema: {schema}; expected 3 to 4, which this program reads");
        assert_eq!(Results::from_json(&text).unwrap_err(), expected);
    }
}

/// Judged with the tolerances that there are without a word.
fn paper(results: &Results) -> Changes {
    against_paper(results, &Tolerances::default())
}

/// What the paper prints and the results have not: as ids are not known, by its own names.
#[test]
fn printed_rows_without_a_counterpart_are_missing() {
    let missing = |changes: &Changes| -> Vec<String> {
        let lines = changes.lines.iter().filter(|line| line.fate == Fate::Missing);
        lines.map(|line| format!("{} {}", line.sequence, line.variant)).collect()
    };
    for experiment in [table_7(), wide_table_7()] {
        let changes = paper(&results(&experiment, run));
        assert_eq!((missing(&changes), changes.compared), (vec!["anna Quaternion".to_owned()], 2));
        let mut other = experiment.clone();
        let rows = &mut other.paper.as_mut().unwrap().rows;
        rows.iter_mut().for_each(|row| row.sequence = "carla".to_owned());
        rows.truncate(2);
        let changes = paper(&results(&other, run));
        assert_eq!((changes.verdict, changes.compared), (Verdict::Incomplete, 0));
        assert_eq!(missing(&changes), ["carla Matrix", "carla Quaternion"]);
        let told = "its sequences are called carla, its variants Matrix, Quaternion";
        assert!(changes.notes[0].text.ends_with(told), "{:?}", changes.notes);
        assert!(junit(&changes).contains("missing: the paper has it"));
    }
}

#[test]
fn a_tolerance_takes_the_place_of_the_last_digit() {
    let with = |tolerance| against_paper(&base(), &Tolerances::each(|_| tolerance)).counts;
    assert_eq!((with(f64::INFINITY).regressed, with(f64::INFINITY).improved), (0, 0));
    assert_eq!(with(0.0).unchanged, 0, "no printed number is ours to the last bit");
}

#[test]
fn less_than_what_is_printed_is_no_verdict_without_a_word() {
    let any = Tolerances::each(|_| f64::INFINITY);
    let edits: [Edit<'_, Results>; 3] = [
        (&|r| r.options.subset.limit = Some(1), "partial: only a part"),
        (
            &|r| r.options.profile = Profile::quick(),
            "profile quick: at most 6 test frames per sequence, images",
        ),
        (
            &|r| {
                let frame = &mut r.tables[0].sequences[0].variants[0].frames[0];
                (frame.score, frame.error) = (None, Some("gone".to_owned()));
            },
            "scores of frames are missing",
        ),
    ];
    for (edit, expected) in edits {
        let mut results = results(&table_7(), run);
        edit(&mut results);
        let changes = against_paper(&results, &any);
        assert_eq!(changes.verdict, Verdict::Incomplete);
        let noted = changes.notes.iter().any(|note| note.text.contains(expected));
        assert!(noted, "{expected}: {:?}", changes.notes);
    }
}

#[test]
fn what_draws_otherwise_is_noted() {
    let mut other = base();
    (other.tables[0].resolution, other.tables[0].antialiased) = (Some(100), true);
    let notes = by_default(&other).notes;
    let texts: Vec<&str> = notes.iter().map(|note| note.text.as_str()).collect();
    assert_eq!(
        texts,
        [
            "table7: images as the profile has them in the baseline, of 100 pixels now",
            "table7: the plain rasterizer drew in the baseline, the antialiased one now",
        ]
    );
}

#[test]
fn results_that_contradict_themselves_are_refused() {
    let edits: [Edit<'_, VariantResults>; 4] = [
        (&|v| v.frames[0].error = Some("gone".to_owned()), "a score and an error; expected one of them"),
        (&|v| v.frames[1].frame = v.frames[0].frame, "frames: frame: `0` twice; expected each once"),
        (&|v| v.summary.as_mut().unwrap().frames = 77, "summary: frames: 77; expected"),
        (
            &|v| v.frames[0].score.as_mut().unwrap().protocol.version += 1,
            "protocol: avatar-v1@2; expected the table's, avatar-v1@1",
        ),
    ];
    for (edit, expected) in edits {
        let mut results = base();
        edit(&mut results.tables[0].sequences[0].variants[0]);
        let problem = Results::from_json(&results.to_json()).unwrap_err();
        assert!(
            problem.starts_with("table `table7`: sequences: `") && problem.contains(expected),
            "{problem}"
        );
    }
    let list = format!("[{}]", base().to_json());
    let expected = "a list; expected an object, as reports/SCHEMA.md says";
    assert_eq!(Results::from_json(&list).unwrap_err(), expected);
}

/// `matrices` is `m` of the paper's table 7.
#[test]
fn real_data_is_judged_by_the_printed_digits() {
    let changes = paper(&base());
    assert!(changes.compared > 0 && changes.counts.regressed + changes.counts.improved > 0, "{changes:?}");
    let line = &changes.lines[0];
    let printed = line.baseline.unwrap();
    assert_eq!(line.tolerance.unwrap(), 0.005, "half of the last of two digits");
    assert_eq!([&*line.sequence, &line.variant], ["gymnasts/anna/anna-test", "matrices"], "ids");
    let shown = text(&changes, true);
    assert!(shown.contains(" Paper ") && shown.contains(" 20.10 "), "its column, its digits: {shown}");
    // Ours moved onto the printed number, and by less than half of its last digit beside it.
    let psnr = |value: f64| {
        let mut results = base();
        let row = &mut results.tables[0].table.rows[0];
        row.cells[0].content = skinsplat_table::Content::Number(value);
        paper(&results).lines[0].fate
    };
    assert_eq!(psnr(printed), Fate::Unchanged);
    assert_eq!(psnr(printed - 0.0049), Fate::Unchanged);
    assert_eq!((psnr(printed - 0.0051), psnr(printed + 0.0051)), (Fate::Regressed, Fate::Improved));
    let mut spread = base();
    let row = &mut spread.tables[0].table.rows[0];
    (row.cells[0].content, row.cells[0].spread) =
        (skinsplat_table::Content::Number(printed - 0.2), Some(0.1));
    assert_eq!(paper(&spread).lines[0].fate, Fate::Unchanged, "within two standard deviations");
    let mut stand_in = base();
    stand_in.tables[0].source = Source::StandIn;
    let changes = paper(&stand_in);
    assert_eq!((changes.verdict, changes.compared), (Verdict::Incomplete, 0));
    assert!(changes.notes[0].text.contains("stand-in data"), "{:?}", changes.notes);
}

#[test]
fn names_with_markup_stay_names() {
    let strange = "<b>|`::error::`&\n]]>\u{7}";
    let with = |by: f64| {
        let mut results = moved(by);
        let sequence = &mut results.tables[0].sequences[0];
        sequence.id = strange.into();
        sequence
            .variants
            .iter_mut()
            .flat_map(|v| &mut v.frames)
            .for_each(|f| f.name = format!("{}{strange}", f.name));
        results
    };
    let changes = compare(&with(0.0), &with(-0.6), &Tolerances::default());
    assert_eq!(changes.counts.regressed, 1);
    let page = markdown(&changes, true);
    assert!(!page.contains("<b>"), "{page}");
    let annotations = github(&changes);
    assert!(
        annotations
            .lines()
            .all(|line| line.starts_with("::error title=") || line.starts_with("::notice title="))
    );
    assert!(!junit(&changes).contains("<b>"));
}
