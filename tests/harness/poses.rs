//! Noise on poses, several takes, and test poses that are fitted: what a plan and a table make of them.

use crate::made_up::{TABLE_7, fitted_table_7, options, own_data, run, sequence};
use skinsplat::experiment::{
    AvatarRecipe, AvatarSource, Dataset, Experiment, FittedOutcome, Outcome, Plan, Records, Role, TestPoses,
    plan,
};
use skinsplat::report::{self, TableResults};
use skinsplat_metrics::MetricId;
use skinsplat_table::{Content, Row, RowKind};

fn with(keys: &str) -> Experiment {
    fitted_table_7(keys).unwrap()
}

fn planned(experiment: &Experiment, data: &Dataset) -> Plan {
    plan(std::slice::from_ref(experiment), std::slice::from_ref(data), &options()).unwrap()
}

fn keys(plan: &Plan) -> Vec<String> {
    plan.jobs.iter().flat_map(|job| &job.variants).map(|variant| variant.key.clone()).collect()
}

/// Every frame scored as given, and one dB better with its pose fitted, but for the frames that `fails` names.
fn both(plan: &Plan, fails: impl Fn(&str) -> bool) -> Records {
    let mut records = run(plan);
    for job in &plan.jobs {
        for variant in &job.variants {
            let record = records.get_mut(&variant.key).unwrap();
            let Outcome::Scored { score, fitted, .. } = &mut record.outcome else { unreachable!() };
            let mut better = score.clone();
            better.values.insert(MetricId::PSNR, score.values.get(MetricId::PSNR).unwrap() + 1.0);
            *fitted = Some(match fails(&job.name) {
                true => FittedOutcome::Failed("the mask of the image is empty".to_owned()),
                false => FittedOutcome::Scored { score: better, turned_degrees: 3.0 },
            });
        }
    }
    records
}

fn table(experiment: &Experiment, records: impl Fn(&Plan) -> Records) -> TableResults {
    let plan = planned(experiment, &own_data(12));
    report::results(&plan, std::slice::from_ref(experiment), &records(&plan)).unwrap().tables.remove(0)
}

/// The rows of this run alone.
fn measured(found: &TableResults) -> impl Iterator<Item = &Row> {
    found.table.rows.iter().filter(|row| matches!(row.kind, RowKind::Measured | RowKind::Mean))
}

#[test]
fn fitted_scores_stand_beside_those_as_given() {
    let experiment = with("test_poses = \"fitted\"");
    let found = table(&experiment, |plan| both(plan, |_| false));
    let titles: Vec<&str> = found.table.columns.iter().map(|column| column.title.as_str()).collect();
    let given = titles.iter().filter(|title| title.contains("(as given)")).count();
    let fitted = titles.iter().filter(|title| title.contains("(fitted)")).count();
    assert!(given > 0 && given == fitted, "{titles:?}");
    for (c, title) in titles.iter().enumerate().filter(|(_, title)| title.contains("(fitted)")) {
        assert_eq!(titles[c - 1], title.replace("(fitted)", "(as given)"));
    }
    let psnr = titles.iter().position(|title| title.contains("(fitted)")).unwrap();
    for row in measured(&found) {
        let value = |c: usize| row.cells[c].content.value().unwrap();
        assert!((value(psnr) - value(psnr - 1) - 1.0).abs() < 1e-9);
    }
    assert!(found.table.sentences.iter().any(|s| s.starts_with("Test poses: \"as given\"")));
    let comparison = &found.comparisons[0];
    assert_eq!(comparison.differences.iter().filter(|d| d.fitted).count(), fitted);
    // Without being asked for there is no such column, and no other key.
    let plain = with("");
    assert_eq!(plain.test_poses, TestPoses::AsGiven);
    assert!(table(&plain, run).table.columns.iter().all(|column| !column.title.contains("fitted")));
    let [plain, fitted] = [plain, experiment].map(|e| keys(&planned(&e, &own_data(6))));
    assert!(plain.iter().all(|key| !fitted.contains(key)));
}

#[test]
fn a_pose_that_cannot_be_fitted_leaves_n_c_and_the_score_as_given() {
    let experiment = with("test_poses = \"fitted\"");
    let found = table(&experiment, |plan| both(plan, |name| name == "image_0003"));
    let column = found.table.columns.iter().position(|column| column.title.contains("(fitted)")).unwrap();
    for row in measured(&found) {
        assert_eq!(row.cells[column].content, Content::NotComputed, "{row:?}");
        assert!(row.cells[column - 1].content.value().is_some());
    }
    let note = "no pose was fitted in 1 of 12 frames: image_0003 (the mask of the image is empty)";
    assert!(found.table.notes.iter().any(|own| own.contains(note)), "{:?}", found.table.notes);
}

#[test]
fn noise_is_part_of_keys_and_captions() {
    let data = own_data(6);
    let [without, none, some, seeded] =
        ["", "pose_noise = 0.0", "pose_noise = 5.0", "pose_noise = 5.0\npose_noise_seed = 1"].map(with);
    let all = [&without, &none, &some, &seeded].map(|e| keys(&planned(e, &data)));
    assert_eq!(all[0], all[1], "no noise is no noise");
    assert!(all[2].iter().all(|key| !all[0].contains(key) && !all[3].contains(key)));
    let plan = planned(&some, &data);
    let training = plan.avatars.iter().find_map(|avatar| avatar.training()).unwrap();
    assert_eq!(training.noise.map(|noise| noise.degrees), Some(5.0));
    assert_eq!(plan.jobs[0].variants[0].noise, training.noise);
    let sentence = "Pose noise: 5 degrees per joint";
    assert!(table(&some, run).table.sentences.iter().any(|own| own.starts_with(sentence)));
}

#[test]
fn keys_without_effect_are_refused() {
    for (keys, field) in
        [("test_pose = { steps = 3 }", "test_pose"), ("pose_noise_seed = 4", "pose_noise_seed")]
    {
        let refused = fitted_table_7(keys).unwrap_err().to_string();
        assert!(refused.contains(field) && refused.contains("of no effect"), "{refused}");
    }
    assert!(fitted_table_7("test_poses = \"fitted\"\ntest_pose = { steps = 3 }").is_ok());
}

/// Refined training poses are never mixed in silently.
#[test]
fn refined_training_poses_are_in_the_caption() {
    let said = |experiment: &Experiment| {
        let found = table(experiment, run).table.sentences;
        found.into_iter().find(|own| own.starts_with("Training poses: fitted with the avatar in "))
    };
    let mut experiment = with("");
    assert_eq!(said(&experiment), None);
    let label = experiment.variants[1].label.clone();
    let AvatarRecipe::Fit { name, .. } = &mut experiment.variants[1].avatar else { panic!("a fit") };
    name.push_str("+poses=refine");
    assert!(said(&experiment).unwrap().ends_with(&label));
}

#[test]
fn takes_are_joined_and_a_subject_with_too_few_costs_its_own_cells() {
    let mut data = own_data(6);
    data.subjects[0].sequences.push(sequence("anna-more", Role::Train, 10));
    let mut experiment = with("");
    experiment.variants[1].takes = Some(2);
    let id = experiment.variants[1].id.clone();
    let plan = planned(&experiment, &data);
    let of = |subject: &str| {
        let job = plan.jobs.iter().find(|job| job.subject == subject).unwrap();
        let key = &job.variants.iter().find(|variant| variant.id == id).unwrap().avatar;
        &plan.avatar(key).unwrap().source
    };
    let AvatarSource::Fit { training, .. } = of("anna") else { panic!("anna has both takes") };
    assert_eq!(
        training.further.iter().map(|(id, frames)| (id.as_str(), frames.len())).collect::<Vec<_>>(),
        [("anna-more", 10)]
    );
    let AvatarSource::Missing { problem } = of("bob") else { panic!("bob has one take") };
    assert!(problem.contains("bob has 1 of the 2 training sequences"), "{problem}");
}

#[test]
fn values_out_of_range_are_refused_by_name() {
    for (keys, field) in [
        ("pose_noise = 91.0", "pose_noise"),
        ("pose_noise = -1.0", "pose_noise"),
        ("pose_noise = nan", "pose_noise"),
        ("test_poses = \"guessed\"", "guessed"),
        ("test_pose = { steps = 0 }", "test_pose"),
        ("test_pose = { rate = -1.0 }", "test_pose"),
        ("test_pose = { spin = 1 }", "spin"),
    ] {
        let error = fitted_table_7(keys).unwrap_err().to_string();
        assert!(error.contains(field) && !error.contains('\n'), "{keys}: {error}");
    }
    for keys in ["pose_noise = 100.0", "takes = 0"] {
        let text = TABLE_7.replacen("[[variants]]", &format!("[[variants]]\n{keys}"), 1);
        let error = Experiment::parse(&text, "table7.toml").unwrap_err().to_string();
        assert!(error.contains("variants[0]"), "{error}");
    }
}
