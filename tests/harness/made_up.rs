//! Made-up data sets, experiments and scores.

use skinsplat::experiment::{
    AvatarFile, AvatarState, Dataset, Experiment, FrameInfo, FrameRecord, Options, Outcome, Plan, Profile,
    Records, Role, Seconds, SequenceInfo, SubjectInfo, Subset, plan,
};
use skinsplat::report::{self, Results, TableResults};
use skinsplat_data::Capture;
use skinsplat_metrics::{FrameScore, MetricId, Protocol};
use std::collections::BTreeMap;

/// A seventh table: not one of the paper's, on a data set that no code knows.
pub(super) const TABLE_7: &str = include_str!("table7.toml");

pub(super) fn table_7() -> Experiment {
    Experiment::parse(TABLE_7, "table7.toml").unwrap()
}

/// The seventh table with fits in place of surfaces, and more keys.
pub(super) fn fitted_table_7(keys: &str) -> Result<Experiment, skinsplat::experiment::Error> {
    let text = TABLE_7
        .replace("{ recipe = \"surface-vertex\" }", "{ recipe = \"fit\", name = \"pure-skinned\" }")
        .replace("sequences = [", &format!("{keys}\nsequences = ["))
        .replace("sh_degree = 1\n", "");
    Experiment::parse(&text, "table7.toml")
}

/// The seventh table in the wide layout.
pub(super) fn wide_table_7() -> Experiment {
    let text = TABLE_7.replace("layout = \"rows\"", "layout = \"wide\"").replace("\"Mean\"", "\"All\"");
    Experiment::parse(&text, "table7.toml").unwrap()
}

pub(super) fn options() -> Options {
    Options {
        profile: Profile::standard(),
        subset: Subset::default(),
        lpips_weights: None,
        seeds: Vec::new(),
    }
}

pub(super) fn sequence(id: &str, role: Role, frames: usize) -> SequenceInfo {
    let frame = |time| FrameInfo { name: format!("image_{time:04}"), time, camera: 0 };
    let digest = format!("digest of {id}");
    SequenceInfo { id: id.into(), role, digest, frames: (0..frames).map(frame).collect(), image: None }
}

pub(super) fn subject(id: &str, capture: Capture, sequences: Vec<SequenceInfo>) -> SubjectInfo {
    let (notes, avatars, renders) = Default::default();
    SubjectInfo { id: id.into(), capture, sequences, split_given: false, notes, avatars, renders }
}

/// The seventh table's own data: subjects `anna` and `bob`.
pub(super) fn own_data(test_frames: usize) -> Dataset {
    let person = |id: &str| {
        let train = sequence(&format!("{id}-train"), Role::Train, 20);
        let test = sequence(&format!("{id}-test"), Role::Test, test_frames);
        let mut person = subject(id, Capture::Monocular, vec![train, test]);
        person.avatars.push(fitted_file(id));
        person
    };
    let subjects = vec![person("anna"), person("bob")];
    Dataset { id: "gymnasts".into(), title: "Gymnasts".into(), subjects, unreadable: Vec::new() }
}

/// The file of a subject's fitted avatar.
pub(super) fn fitted_file(subject: &str) -> AvatarFile {
    let digest = format!("{subject:f<64}");
    let state = AvatarState::Present { digest, notes: Vec::new() };
    AvatarFile { name: "fitted".into(), path: format!("avatars/{subject}.ply").into(), state }
}

/// Data that may stand in: one subject of each kind of capture.
pub(super) fn figures() -> Dataset {
    let figure = |id: &str, capture| {
        let train = sequence(&format!("{id}-train"), Role::Train, 8);
        let tests = [
            sequence(&format!("{id}-twist"), Role::Test, 6),
            sequence(&format!("{id}-squat"), Role::Test, 4),
        ];
        subject(id, capture, [train].into_iter().chain(tests).collect())
    };
    let subjects = vec![
        figure("mono", Capture::Monocular),
        figure("multi", Capture::Multiview),
        figure("hands", Capture::Hands),
    ];
    Dataset { id: "figures".into(), title: "Figures".into(), subjects, unreadable: Vec::new() }
}

pub(super) fn score(protocol: &str, psnr: f64, ssim: f64, lpips: Option<f64>) -> FrameScore {
    let mse = 10_f64.powf(-psnr / 10.0);
    let values = [(MetricId::PSNR, psnr), (MetricId::SSIM, ssim), (MetricId::SPLATS, 100.0)];
    let values = values.into_iter().chain(lpips.map(|lpips| (MetricId::LPIPS, lpips))).collect();
    let missing = lpips.is_none().then(|| (MetricId::LPIPS, "no weights".to_owned()));
    FrameScore {
        protocol: Protocol::parse(protocol).unwrap().key(),
        pixels: 100,
        channel_mse: [mse; 3],
        mse,
        values,
        not_computed: missing.into_iter().collect::<BTreeMap<_, _>>(),
    }
}

pub(super) fn record(key: &str, outcome: Outcome) -> FrameRecord {
    let (label, seconds) = (format!("label of {key}"), Seconds::default());
    FrameRecord { key: key.into(), label, outcome, seconds, bend: None, bytes: None }
}

pub(super) fn scored(key: &str, score: FrameScore) -> FrameRecord {
    record(key, Outcome::Scored { score, visible_splats: Some(90), fitted: None })
}

/// A score for everything in the plan: frame k of variant v in row r has PSNR `20 + r + v / 2 + k / 10`.
pub(super) fn run(plan: &Plan) -> Records {
    let mut records = Records::new();
    for job in &plan.jobs {
        for variant in &job.variants {
            let v = plan.tables[job.table].variants.iter().position(|id| *id == variant.id).unwrap() as f64;
            let psnr = 20.0 + job.row as f64 + v / 2.0 + job.frame as f64 / 10.0;
            let score = score(&job.protocol.id, psnr, 0.9 + psnr / 1000.0, Some(0.2 - psnr / 1000.0));
            records.insert(variant.key.clone(), scored(&variant.key, score));
        }
    }
    records
}

/// The results of an experiment on its own data.
pub(super) fn results(experiment: &Experiment, records: impl Fn(&Plan) -> Records) -> Results {
    let experiments = [experiment.clone()];
    let plan = plan(&experiments, &[own_data(6)], &options()).unwrap();
    report::results(&plan, &experiments, &records(&plan)).unwrap()
}

/// The table of an experiment on its own data.
pub(super) fn table(experiment: &Experiment, records: impl Fn(&Plan) -> Records) -> TableResults {
    results(experiment, records).tables.remove(0)
}

/// The made-up scores with a hole: of anna's frames, one failed and one was not run; bob's matrices have no LPIPS and
/// his quaternions hit one frame exactly.
pub(super) fn with_holes(plan: &Plan) -> Records {
    let mut records = run(plan);
    let key = |job: usize, variant: usize| plan.jobs[job].variants[variant].key.clone();
    records
        .insert(key(1, 0), record(&key(1, 0), Outcome::Error("truth: image_0001.png is truncated".into())));
    records.remove(&key(2, 0));
    for job in 6..12 {
        records.insert(key(job, 0), scored(&key(job, 0), score("avatar-v1", 21.0, 0.5, None)));
    }
    records.insert(key(7, 1), scored(&key(7, 1), score("avatar-v1", f64::INFINITY, 1.0, Some(0.0))));
    records
}
