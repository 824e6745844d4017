//! Plans: pure, paired, keyed by everything that numbers depend on.

use super::made_up::{figures, options, own_data, sequence, subject, table_7};
use skinsplat::experiment::{
    AvatarRecipe, AvatarSource, AvatarState, Dataset, Experiment, FrameInfo, Options, Plan, PlannedAvatar,
    Profile, Role, SequenceInfo, Source, SubjectInfo, Subset, TrainingFrames, plan,
};
use skinsplat_data::Capture;
use skinsplat_data::key::canonical_json;
use std::collections::BTreeSet;

fn planned(experiments: &[Experiment], datasets: &[Dataset]) -> Plan {
    plan(experiments, datasets, &options()).unwrap()
}

/// The training frames of the first avatar.
fn training(plan: &Plan) -> &TrainingFrames {
    plan.avatars[0].training().unwrap()
}

fn keys(plan: &Plan) -> Vec<&str> {
    plan.jobs.iter().flat_map(|job| &job.variants).map(|variant| variant.key.as_str()).collect()
}

#[test]
fn a_plan_depends_on_its_arguments_alone() {
    let experiments = Experiment::embedded();
    let (first, again) = (planned(&experiments, &[figures()]), planned(&experiments, &[figures()]));
    assert_eq!(first, again);
    assert_eq!(canonical_json(&first), canonical_json(&again));
    let renamed = Dataset { title: "Others".into(), ..figures() };
    assert_eq!(keys(&first), keys(&planned(&experiments, &[renamed])));
}

#[test]
fn own_data_wins_over_stand_ins_and_frames_are_in_order() {
    let plan = planned(&[table_7()], &[figures(), own_data(3)]);
    let table = &plan.tables[0];
    assert_eq!(table.source, Source::Own);
    assert_eq!(table.datasets, [("gymnasts".to_owned(), "Gymnasts".to_owned())]);
    let labels: Vec<&str> = table.rows.iter().map(|row| row.label.as_str()).collect();
    assert_eq!(labels, ["anna", "bob"]);
    let frames: Vec<(usize, &str)> = plan.jobs.iter().map(|job| (job.row, job.name.as_str())).collect();
    let names = ["image_0000", "image_0001", "image_0002"];
    let expected: Vec<(usize, &str)> = (0..2).flat_map(|row| names.map(|name| (row, name))).collect();
    assert_eq!(frames, expected);
    assert!(plan.jobs.iter().all(|job| job.variants.len() == 2 && job.protocol.id == "avatar-v1"));
}

#[test]
fn stand_ins_are_of_the_right_kind_and_all_of_their_test_sequences_run() {
    let plan = planned(&Experiment::embedded(), &[figures()]);
    for (table, who) in plan.tables.iter().zip(["mono", "mono", "mono", "multi", "mono", "hands"]) {
        assert_eq!(table.source, Source::StandIn);
        let labels: Vec<&str> = table.rows.iter().map(|row| row.label.as_str()).collect();
        assert_eq!(labels, [format!("{who} / {who}-twist"), format!("{who} / {who}-squat")]);
    }
    assert_eq!(plan.tables[3].protocol.id, "animatable-gala+background=[1.0, 1.0, 1.0]");
    let two =
        planned(&Experiment::embedded()[..1], &[figures(), Dataset { id: "dolls".into(), ..figures() }]);
    let labels: Vec<&str> = two.tables[0].rows.iter().map(|row| row.label.as_str()).collect();
    assert_eq!(labels[0], "figures: mono / mono-twist");
    assert_eq!(labels[2], "dolls: mono / mono-twist");
    let none = planned(&Experiment::embedded()[..1], &[]);
    assert_eq!((none.tables[0].source, none.jobs.len()), (Source::Absent, 0));
}

#[test]
fn validation_sequences_are_scored_where_a_table_names_them_and_who_has_none_says_so() {
    let mut data = figures();
    data.subjects[0].sequences.push(sequence("val", Role::Val, 5));
    data.subjects.push(subject("other", Capture::Monocular, data.subjects[0].sequences[..2].to_vec()));
    let labels = |experiment: Experiment| -> Vec<(String, Option<String>)> {
        let plan = planned(&[experiment], &[data.clone()]);
        plan.tables[0].rows.iter().map(|row| (row.label.clone(), row.missing.clone())).collect()
    };
    let mut table = Experiment::embedded().remove(0);
    let names: Vec<String> = labels(table.clone()).into_iter().map(|(label, _)| label).collect();
    assert_eq!(names, ["mono / mono-twist", "mono / mono-squat", "other / mono-twist"]);
    table.stand_in.as_mut().unwrap().test = vec!["val".to_owned()];
    let missing = Some("`other` has no sequence val".to_owned());
    assert_eq!(labels(table), [("mono / val".to_owned(), None), ("other".to_owned(), missing)]);
}

#[test]
fn avatars_are_shared_by_tables_that_make_the_same_ones() {
    let plan = planned(&Experiment::embedded(), &[figures()]);
    let made: Vec<(&str, &str)> = plan
        .avatars
        .iter()
        .map(|avatar| {
            let recipe = match &avatar.source {
                AvatarSource::Fit { fit, .. } => fit.options.recipe.id.as_str(),
                AvatarSource::Textured { .. } => "mesh",
                other => panic!("{other:?}"),
            };
            (avatar.subject.as_str(), recipe)
        })
        .collect();
    assert_eq!(
        made,
        [
            ("mono", "hugs-original"),
            ("mono", "hugs-skinned"),
            ("mono", "ihuman-original"),
            ("mono", "ihuman-skinned"),
            ("mono", "splattingavatar-original"),
            ("mono", "splattingavatar-skinned"),
            ("mono", "splattingavatar-skinned-degree-0"),
            ("multi", "animatable-original"),
            ("multi", "animatable-balls"),
            ("multi", "animatable-skinned"),
            ("mono", "animatable-original"),
            ("mono", "animatable-balls"),
            ("mono", "animatable-skinned"),
            ("hands", "haha"),
            ("hands", "mesh"),
            ("hands", "pure-skinned"),
        ]
    );
    let start = |avatar: &'_ PlannedAvatar| match &avatar.source {
        AvatarSource::Fit { fit, .. } => Some(fit.start.clone()),
        _ => None,
    };
    let starts: BTreeSet<String> = plan.avatars.iter().filter_map(start).collect();
    assert_eq!(
        starts.len(),
        8,
        "on mono's vertices, faces and samples, on multi's vertices, on hands' faces and fitted surface; balls on mono's and multi's \
         vertices"
    );
    let swap = Experiment::embedded_all().into_iter().filter(|experiment| experiment.id == "swap");
    let swap = planned(&swap.collect::<Vec<_>>(), &[figures()]);
    assert_eq!(swap.avatars.len(), 5 * 3 * 3, "five fits of three subjects with three seeds");
    let known: BTreeSet<&str> = plan.avatars.iter().map(|avatar| avatar.key.as_str()).collect();
    assert!(plan.jobs.iter().flat_map(|job| &job.variants).all(|v| known.contains(v.avatar.as_str())));
}

/// A change and what it is called.
type Change<'a> = (&'a str, &'a dyn Fn(&mut Experiment));

/// Everything that a number depends on moves its key, and nothing else does.
#[test]
fn keys_follow_what_numbers_depend_on() {
    let base = planned(&[table_7()], &[own_data(3)]);
    let with = |change: &dyn Fn(&mut Experiment)| {
        let mut experiment = table_7();
        change(&mut experiment);
        planned(&[experiment], &[own_data(3)])
    };
    let first = |plan: &Plan| plan.jobs[0].variants[0].key.clone();
    let depends: [Change; 6] = [
        ("protocol", &|e| e.protocol = "haha".into()),
        ("protocol choice", &|e| e.protocol = "avatar-v1+ssim=uniform7".into()),
        ("strategy", &|e| e.variants[0].strategy = Some("face-tbn".into())),
        ("SH degree", &|e| e.variants[0].sh_degree = Some(2)),
        ("recipe", &|e| e.variants[0].avatar = AvatarRecipe::SurfaceFace {}),
        ("antialiasing", &|e| e.antialiased = true),
    ];
    let mut seen = BTreeSet::from([first(&base)]);
    for (what, change) in depends {
        assert!(seen.insert(first(&with(change))), "{what}");
    }
    let fitted = |name: &str, seed: u64, profile: Profile| {
        let mut experiment = table_7();
        experiment.variants[0].avatar = AvatarRecipe::Fit { name: name.into(), seed };
        experiment.variants[0].sh_degree = None;
        let options = Options { profile, ..options() };
        first(&plan(&[experiment], &[own_data(3)], &options).unwrap())
    };
    let (standard, longer) =
        (Profile::standard(), Profile { fit_iterations: Some(2001), ..Profile::standard() });
    for (what, name, seed, profile) in [
        ("fit", "hugs-skinned", 0, &standard),
        ("seed", "hugs-skinned", 1, &standard),
        ("recipe's strategy", "hugs-original", 0, &standard),
        ("recipe's choice", "hugs-skinned+rates.rotation=0.1", 0, &standard),
        ("iterations", "hugs-skinned", 0, &longer),
    ] {
        assert!(seen.insert(fitted(name, seed, profile.clone())), "{what}");
    }
    let same = "hugs-skinned+rates.rotation=4e-3";
    assert_eq!(fitted(same, 0, standard.clone()), fitted("hugs-skinned", 0, standard), "names do not count");
    let free: [Change; 4] = [
        ("id", &|e| e.id = "other".into()),
        ("captions", &|e| e.caption = "Other".into()),
        ("label", &|e| e.variants[0].label = "Other".into()),
        ("another spec of the same strategy", &|e| {
            e.variants[0].strategy = Some("lbs+rotation=gram-schmidt-columns".into());
        }),
    ];
    for (what, change) in free {
        assert_eq!(first(&with(change)), first(&base), "{what}");
    }
    let mut data = own_data(3);
    data.subjects[0].sequences[0].digest += "!";
    assert_ne!(first(&planned(&[table_7()], &[data])), first(&base), "training data");
    let mut data = own_data(3);
    data.subjects[0].sequences[1].digest += "!";
    let moved = planned(&[table_7()], &[data]);
    assert_ne!(first(&moved), first(&base), "test data");
    assert_eq!(keys(&moved)[6..], keys(&base)[6..], "the other subject's");
    let quick = Options { profile: Profile::quick(), ..options() };
    assert_ne!(first(&plan(&[table_7()], &[own_data(3)], &quick).unwrap()), first(&base), "resolution");
    assert_eq!(keys(&base).iter().collect::<BTreeSet<_>>().len(), 12);
}

#[test]
fn a_subset_keeps_the_keys_of_what_is_left_and_is_recorded() {
    let all = planned(&[table_7()], &[own_data(10)]);
    let subset = Subset {
        frames: Some([2, 8]),
        limit: Some(3),
        subjects: vec!["bob".into()],
        variants: vec!["quaternions".into()],
    };
    let part = plan(&[table_7()], &[own_data(10)], &Options { subset, ..options() }).unwrap();
    assert!(part.is_partial() && !all.is_partial());
    assert_ne!(part.digest, all.digest);
    let frames: Vec<usize> = part.jobs.iter().map(|job| job.frame).collect();
    assert_eq!(frames, [2, 3, 4]);
    let known: BTreeSet<&str> = keys(&all).into_iter().collect();
    assert!(keys(&part).iter().all(|key| known.contains(key)));
    for (subset, message) in [
        (
            Subset { subjects: vec!["eve".into()], ..Subset::default() },
            "subjects: `eve`; expected one of anna, bob",
        ),
        (
            Subset { variants: vec!["x".into()], ..Subset::default() },
            "variants: `x`; expected one of matrices, qua",
        ),
    ] {
        let error =
            plan(&[table_7()], &[own_data(3)], &Options { subset, ..options() }).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn profiles_thin_frames_evenly() {
    let profile = Profile { max_train_frames: Some(4), max_test_frames: Some(2), ..Profile::standard() };
    let plan = plan(&[table_7()], &[own_data(10)], &Options { profile, ..options() }).unwrap();
    let frames: Vec<usize> = plan.jobs.iter().map(|job| job.frame).collect();
    assert_eq!(frames, [2, 7, 2, 7]);
    assert_eq!(training(&plan).frames, [2, 7, 12, 17]);
    assert_eq!(training(&plan).sequence, "anna-train");
}

/// One sequence that an experiment splits by frame number and camera, as PeopleSnapshot and GalaBasketball are.
/// A data set of one subject.
fn dataset(id: &str, subject: SubjectInfo) -> Dataset {
    Dataset { id: id.into(), title: id.into(), subjects: vec![subject], unreadable: Vec::new() }
}

/// Each table trains and tests on its own method's frames of what a layout has, unless the registry says otherwise.
#[test]
fn splits_cut_sequences_of_a_role_unless_the_registry_has_its_own() {
    let train: Vec<FrameInfo> = sequence("", Role::Train, 456).frames.into_iter().step_by(4).collect();
    let test: Vec<FrameInfo> =
        sequence("", Role::Test, 676).frames.into_iter().skip(456).step_by(4).collect();
    let of = |id: &str, role, frames: &Vec<FrameInfo>| SequenceInfo {
        frames: frames.clone(),
        ..sequence(id, role, 0)
    };
    let sequences = vec![of("train", Role::Train, &train), of("test", Role::Test, &test)];
    let mut person = subject("male-3", Capture::Monocular, sequences);
    let experiments = Experiment::embedded();
    let counts = |person: &SubjectInfo, table: usize| {
        let plan = planned(&experiments[table..=table], &[dataset("peoplesnapshot", person.clone())]);
        (training(&plan).frames.len(), plan.jobs.len(), plan.jobs[0].resolution)
    };
    assert_eq!(counts(&person, 1), (19, 55, Some(540)), "iHuman's frames");
    assert_eq!(counts(&person, 4), (114, 55, Some(540)), "Animatable's frames");
    assert_eq!(counts(&person, 2).2, None, "SplattingAvatar's resolution is that of the images");
    person.split_given = true;
    assert_eq!(counts(&person, 1), (114, 55, Some(540)), "the registry's frames");
}

#[test]
fn splits_cut_whole_sequences() {
    let experiments = Experiment::embedded();
    let mut whole = sequence("male-3", Role::Whole, 676);
    let person = subject("male-3", Capture::Monocular, vec![whole.clone()]);
    let plan = planned(&experiments[1..2], &[dataset("peoplesnapshot", person)]);
    assert_eq!((plan.jobs.len(), training(&plan).frames.len()), (55, 19));
    assert_eq!((plan.jobs[0].frame, plan.jobs[54].frame), (456, 672));
    let missing: Vec<&str> =
        plan.tables[0].rows[1..].iter().map(|row| row.missing.as_deref().unwrap()).collect();
    assert_eq!(missing[0], "the data set has no subject `female-3`");

    whole.id = "dribble".into();
    whole.frames = (0..7)
        .flat_map(|camera| {
            sequence("", Role::Whole, 60).frames.into_iter().map(move |mut frame| {
                frame.camera = camera;
                frame
            })
        })
        .collect();
    let ball = subject("dribble", Capture::Multiview, vec![whole]);
    let plan = planned(&experiments[3..4], &[dataset("galabasketball", ball)]);
    assert_eq!((plan.jobs.len(), training(&plan).frames.len()), (30, 180));
    assert_eq!(plan.jobs[0].frame, 6 * 60);
    assert_eq!(plan.tables[0].protocol.id, "animatable-gala");

    let takes = ["train/Take4", "train/Take6", "train/Take8"].map(|id| sequence(id, Role::Train, 5));
    let hands = subject("00016", Capture::Hands, takes.to_vec());
    let plan = planned(&experiments[5..], &[dataset("xhumans", hands)]);
    assert_eq!(plan.tables[0].rows[0].sequence, "train/Take6");
    assert_eq!(training(&plan).sequence, "train/Take4");
}

/// The seventh table with a file as the avatar of its first variant.
fn with_file(name: &str, otherwise: Option<&str>) -> Experiment {
    let mut experiment = table_7();
    let otherwise = otherwise.map(str::to_owned);
    experiment.variants[0].avatar = AvatarRecipe::File { name: name.into(), otherwise };
    experiment.variants[0].sh_degree = None;
    experiment
}

fn refusal(experiment: Experiment, data: Dataset) -> String {
    plan(&[experiment], &[data], &options()).unwrap_err().to_string()
}

#[test]
fn fitted_avatars_come_by_name() {
    let planned_file = planned(&[with_file("fitted", None)], &[own_data(2)]);
    let AvatarSource::File { name, digest, sequence, .. } = &planned_file.avatars[0].source else { panic!() };
    assert_eq!((name.as_str(), &digest[..6], sequence.as_str()), ("fitted", "annaff", "anna-train"));
    assert!(planned_file.avatars[0].training().is_none());
    let error = refusal(with_file("other", None), own_data(2));
    assert!(
        error.contains("variants[0].avatar: variant matrices: gymnasts/anna has no avatar `other`; expected")
            && error.contains("registered: fitted"),
        "{error}"
    );
    let mut data = own_data(2);
    data.subjects[1].sequences.remove(0);
    let error = refusal(table_7(), data);
    assert!(error.contains("gymnasts/bob has no training sequence"), "{error}");
}

#[test]
fn the_content_of_a_file_is_in_its_key_and_its_place_is_not() {
    let key = |data: Dataset| planned(&[with_file("fitted", None)], &[data]).avatars[0].key.clone();
    let mut moved = own_data(2);
    moved.subjects[0].avatars[0].path = "elsewhere.ply".into();
    assert_eq!(key(moved), key(own_data(2)));
    let mut other = own_data(2);
    let AvatarState::Present { digest, .. } = &mut other.subjects[0].avatars[0].state else { panic!() };
    digest.replace_range(..1, "0");
    assert_ne!(key(other), key(own_data(2)));
    let mut body = own_data(2);
    body.subjects[0].sequences[0].digest += "!";
    assert_ne!(key(body), key(own_data(2)), "the body that it is bound to");
}

#[test]
fn a_file_that_is_missing_or_broken_is_named_unless_a_fit_replaces_it() {
    let with = |state: AvatarState| {
        let mut data = own_data(2);
        data.subjects[1].avatars[0].state = state;
        data
    };
    let error = refusal(with_file("fitted", None), with(AvatarState::Absent));
    for part in ["variants[0].avatar", "variant matrices", "gymnasts/bob", "avatars/bob.ply", "otherwise"] {
        assert!(error.contains(part), "no `{part}` in {error}");
    }
    let broken = AvatarState::Broken { problem: "bob.ply: joint[3]: 99; expected less".into() };
    let error = refusal(with_file("fitted", Some("hugs-skinned")), with(broken));
    assert!(error.contains("gymnasts/bob: bob.ply: joint[3]: 99; expected less"), "{error}");
    let plan = planned(&[with_file("fitted", Some("hugs-skinned"))], &[with(AvatarState::Absent)]);
    let of = |subject: &str| {
        let avatar = plan.avatars.iter().find(|avatar| avatar.subject == subject).unwrap();
        avatar.training().is_some()
    };
    assert_eq!((of("anna"), of("bob")), (false, true));
    let mut fitted = table_7();
    fitted.variants[0].avatar = AvatarRecipe::Fit { name: "hugs-skinned".into(), seed: 0 };
    fitted.variants[0].sh_degree = None;
    let fitted = planned(&[fitted], &[own_data(2)]);
    assert_eq!(keys(&plan).last(), keys(&planned(&[with_file("fitted", None)], &[own_data(2)])).last());
    let key = |plan: &Plan| plan.jobs[2].variants[0].key.clone();
    assert_eq!(key(&plan), key(&fitted), "fitted as any other");
}
