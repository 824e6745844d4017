//! Plans in slices, and plans as files.

use super::made_up::{figures, options, own_data, sequence, subject, table_7};
use proptest::prelude::{prop_assert, prop_assert_eq, proptest};
use skinsplat::experiment::{
    AvatarRecipe, Dataset, Experiment, Job, Options, Plan, Profile, Role, Shard, Slices, plan,
};
use skinsplat::run::plan_file::PlanFile;
use skinsplat_data::Capture;
use std::collections::{BTreeMap, BTreeSet};

/// The six tables and a table on its own data, fitted for so long and on images of so many pixels a side.
fn planned(iterations: u32, side: u32, subjects: usize, frames: usize) -> Plan {
    let mut fitted = table_7();
    fitted.variants[0].avatar = AvatarRecipe::Fit { name: "hugs-skinned".into(), seed: 0 };
    fitted.variants[0].sh_degree = None;
    let people = (0..subjects).map(|number| {
        let train = sequence("train", Role::Train, 20);
        let mut test = sequence("test", Role::Test, frames + number);
        (test.image, test.digest) = (Some([side, side / 2 + 1]), format!("digest of {number}"));
        subject(&format!("person-{number}"), Capture::Monocular, vec![train, test])
    });
    let mut own = Dataset { subjects: people.collect(), ..own_data(1) };
    own.subjects.retain(|subject| !subject.sequences.is_empty());
    let profile = Profile { fit_iterations: Some(iterations), ..Profile::standard() };
    let experiments: Vec<Experiment> = Experiment::embedded().into_iter().chain([fitted]).collect();
    plan(&experiments, &[figures(), own], &Options { profile, ..options() }).unwrap()
}

fn keys(jobs: &[Job]) -> Vec<&str> {
    jobs.iter().flat_map(|job| &job.variants).map(|variant| variant.key.as_str()).collect()
}

proptest! {
    #![proptest_config(proptest::test_runner::Config::with_cases(40))]

    #[test]
    fn every_record_is_in_one_slice_and_slices_cost_alike(
        iterations in 1_u32..3000, side in 16_u32..2000, subjects in 1_usize..5, frames in 1_usize..60, count in 1_usize..12,
    ) {
        let plan = planned(iterations, side, subjects, frames);
        let slices = Slices::of(&plan, count);
        let all: BTreeSet<&str> = keys(&plan.jobs).into_iter().collect();
        let mut owners: BTreeMap<&str, Shard> = BTreeMap::new();
        for shard in Shard::all(count) {
            let jobs = plan.shard(Some(shard));
            let own: BTreeSet<String> = keys(&jobs).into_iter().map(str::to_owned).collect();
            for key in &all {
                if own.contains(*key) {
                    prop_assert_eq!(owners.insert(key, shard), None, "in two slices");
                    prop_assert_eq!(slices.owner(key), Some(shard));
                }
            }
        }
        prop_assert_eq!(owners.len(), all.len(), "in no slice");
        let loads = slices.loads();
        let mean = loads.iter().sum::<u64>() / count as u64;
        let largest = loads.iter().copied().max().unwrap_or_default();
        prop_assert!(largest <= mean + slices.largest_unit() + 1, "{loads:?}, unit {}", slices.largest_unit());
    }
}

#[test]
fn many_frames_are_shared_out_evenly_and_fits_stay_whole() {
    // Frames that cost much more than what they are drawn with: nothing keeps slices from being alike.
    let frames = planned(1, 512, 2, 500);
    let loads = Slices::of(&frames, 8).loads().to_vec();
    let (least, most) = (loads.iter().min().unwrap(), loads.iter().max().unwrap());
    assert!(*most < *least * 5 / 4, "{loads:?}");
    // Fits that cost much more than their frames: each is in one slice.
    let fits = planned(100_000, 512, 4, 20);
    let slices = Slices::of(&fits, 4);
    let mut drawn_in: BTreeMap<&str, BTreeSet<Shard>> = BTreeMap::new();
    for variant in fits.jobs.iter().flat_map(|job| &job.variants) {
        drawn_in.entry(&variant.avatar).or_default().extend(slices.owner(&variant.key));
    }
    let fitted = fits.avatars.iter().filter(|avatar| avatar.label().contains(" fit "));
    assert!(fitted.clone().count() >= 4);
    assert!(fitted.into_iter().all(|avatar| drawn_in[avatar.key.as_str()].len() == 1));
}

#[test]
fn a_plan_survives_its_file_and_is_cut_alike_there() {
    let plan = planned(300, 640, 3, 9);
    let folder = tempfile::tempdir().unwrap();
    let file = PlanFile::new(&plan, &Experiment::embedded(), Vec::new());
    file.write(folder.path()).unwrap();
    let path = folder.path().join(PlanFile::name(&plan.digest));
    let read = PlanFile::read(&path).unwrap();
    assert_eq!(read, file);
    assert_eq!(Slices::of(&read.plan, 5), Slices::of(&plan, 5));
    // What was changed by hand is refused.
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen("image_0001", "image_0002", 1)).unwrap();
    assert!(PlanFile::read(&path).unwrap_err().to_string().contains("digest"));
    file.write(folder.path()).unwrap();
    assert_eq!(PlanFile::read(&path).unwrap(), file, "a damaged file is written again");
    let other = PlanFile::new(&planned(301, 640, 3, 9), &Experiment::embedded(), Vec::new());
    let difference = file.difference(&other).unwrap();
    assert_eq!(difference.field, "options.profile.fit_iterations");
    assert_eq!((difference.first.as_str(), difference.second.as_str()), ("300", "301"));
}
