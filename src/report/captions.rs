//! What a table says about where its numbers come from.

use super::results::SequenceResults;
use crate::experiment::{
    AvatarRecipe, AvatarSource, Experiment, Job, Options, Plan, PlannedTable, Profile, Source, Subset,
    Variant,
};
use skinsplat_data::Capture;
use skinsplat_data::select::each_once;
use skinsplat_fit::recipe::{Poses, Recipe};
use skinsplat_metrics::{MetricId, ROTATION_JUMP_DEGREES};
use std::collections::BTreeSet;

/// The table's caption: of its own data, or the stand-in's, which does not name that data.
pub(super) fn caption(experiment: &Experiment, source: Source) -> String {
    match (&experiment.stand_in, source) {
        (Some(stand_in), Source::StandIn | Source::Absent) => stand_in.caption.clone(),
        _ => experiment.caption.clone(),
    }
}

/// Data, protocol, profile and frames, a sentence each.
pub(super) fn ran_on(
    experiment: &Experiment,
    planned: &PlannedTable,
    options: &Options,
    sequences: &[SequenceResults],
) -> Vec<String> {
    let names: Vec<String> = planned
        .datasets
        .iter()
        .map(|(id, title)| if id == title { id.clone() } else { format!("{title} ({id})") })
        .collect();
    let names = names.join(", ");
    let data = match (planned.source, &experiment.stand_in) {
        (Source::Own, _) => format!("Ran on: {names}"),
        (Source::StandIn, Some(stand_in)) => {
            let kind = stand_in.capture.map_or("any capture", Capture::describe);
            format!(
                "Ran on: {names}, a stand-in ({kind}); not the paper's data and not comparable with its numbers"
            )
        }
        _ => return vec!["Not run: no data for this table".to_owned()],
    };
    let mut sentences = vec![
        data,
        format!("Protocol: {}, version {}", planned.protocol.id, planned.protocol.version),
        profile(&options.profile, experiment, planned.source),
        frames(sequences),
    ];
    if experiment.seeds.len() > 1 {
        let seeds: Vec<String> = experiment.seeds.iter().map(u64::to_string).collect();
        sentences.push(format!("Mean ± standard deviation over the seeds {}", seeds.join(", ")));
    }
    if experiment.antialiased {
        sentences.push("Drawn by the antialiased rasterizer".to_owned());
    }
    sentences.extend(poses(experiment));
    sentences.extend(motion(experiment));
    if !options.subset.is_everything() {
        sentences.push(subset(&options.subset));
    }
    sentences.extend(planned.data_notes.iter().map(|note| format!("Data of {note}")));
    sentences.extend(planned.remarks.iter().cloned());
    if let Some(average) = &experiment.average {
        sentences.push(format!("{}: each sequence counts once", average.label));
    }
    each_once(sentences)
}

/// What was done to poses before training and scoring, a sentence each; nothing where they are as the data has them.
fn poses(experiment: &Experiment) -> Vec<String> {
    let mut sentences = Vec::new();
    let noises: BTreeSet<String> = (experiment.variants.iter())
        .filter_map(|variant| experiment.noise_of(variant))
        .map(|noise| noise.degrees.to_string())
        .collect();
    if !noises.is_empty() {
        let every = experiment.variants.iter().all(|variant| experiment.noise_of(variant).is_some());
        let degrees = noises.into_iter().collect::<Vec<_>>().join(", ");
        let on = if every { "every variant" } else { "the variants that say so" };
        sentences.push(format!(
            "Pose noise: {degrees} degrees per joint (root mean square, smooth in time, seed {}) on training and test poses of {on}",
            experiment.pose_noise_seed
        ));
    }
    let refines = |variant: &&Variant| {
        let recipe = variant.avatar.fitting_recipe().and_then(|name| Recipe::parse(name).ok());
        recipe.is_some_and(|recipe| recipe.poses == Poses::Refine)
    };
    let refined: Vec<&str> =
        experiment.variants.iter().filter(refines).map(|variant| variant.label.as_str()).collect();
    if !refined.is_empty() {
        let all = refined.len() == experiment.variants.len();
        let of = if all { "every variant".to_owned() } else { refined.join("; ") };
        sentences.push(format!("Training poses: fitted with the avatar in {of}"));
    }
    if let Some(options) = experiment.fitted_test_poses() {
        sentences.push(format!(
            "Test poses: \"as given\" as the data has them, \"fitted\" after {} steps on each test image with the avatar frozen",
            options.steps
        ));
        let printed = experiment.paper.as_ref().map(|paper| paper.test_poses.as_deref());
        if let Some(printed) = printed {
            let printed = printed.unwrap_or("the paper does not say whether test poses were fitted");
            sentences.push(format!("Test poses of the paper's numbers: {printed}"));
        }
    }
    sentences
}

/// What columns of motion compare; nothing without such columns.
fn motion(experiment: &Experiment) -> Option<String> {
    let asks = |metric| experiment.columns.iter().any(|column| column.metric == metric);
    let flicker = asks(MetricId::FLICKER).then(|| {
        format!(
            "{}: |(R - R') - (T - T')| of renders R and truths T, mean over channels and the pixels that the protocol scores in \
             either frame, in 1/255",
            MetricId::FLICKER.title()
        )
    });
    let jumps = asks(MetricId::ROTATION_JUMPS).then(|| {
        format!(
            "{}: Gaussians that turn by over {ROTATION_JUMP_DEGREES} degrees more than the widest turn of any joint that they \
             hang on",
            MetricId::ROTATION_JUMPS.title()
        )
    });
    let parts: Vec<String> = flicker.into_iter().chain(jumps).collect();
    let between =
        "Between a frame and the one before it by the same camera in the data's sequence, scored or not";
    (!parts.is_empty()).then(|| format!("{between} (mean of frames that have one): {}", parts.join("; ")))
}

fn profile(profile: &Profile, experiment: &Experiment, source: Source) -> String {
    let mut bounds = Vec::new();
    if let Some(n) = profile.max_test_frames {
        bounds.push(format!("at most {n} test frames per sequence"));
    }
    if let Some(n) = profile.max_train_frames {
        bounds.push(format!("at most {n} training frames"));
    }
    if let Some(side) = experiment.resolution_on(source, profile) {
        bounds.push(format!("images of at most {side} pixels a side"));
    }
    if bounds.is_empty() {
        bounds.push("every frame at native resolution".to_owned());
    }
    let fitted = |variant: &Variant| variant.avatar.fitting_recipe().is_some();
    if let Some(n) = profile.fit_iterations
        && experiment.variants.iter().any(fitted)
    {
        bounds.push(format!("fits of at most {n} iterations"));
    }
    if Profile::preset(&profile.id).is_some_and(|preset| preset.avatar_edge_mm != profile.avatar_edge_mm) {
        bounds.push(format!("avatars made with edges of at most {} mm", profile.avatar_edge_mm));
    }
    format!("Profile: {}, {}", profile.id, bounds.join(", "))
}

/// How many frames a variant was planned to be scored on.
fn frames(sequences: &[SequenceResults]) -> String {
    let counts: Vec<usize> =
        sequences.iter().map(|s| s.variants.first().map_or(0, |variant| variant.frames.len())).collect();
    let total: usize = counts.iter().sum();
    let spread = match (counts.iter().min(), counts.iter().max()) {
        (Some(low), Some(high)) if low == high => format!("{low} each"),
        (Some(low), Some(high)) => format!("{low} to {high} each"),
        _ => "none".to_owned(),
    };
    format!("Frames: {total} per variant, in {} ({spread})", count(sequences.len(), "sequence"))
}

fn subset(subset: &Subset) -> String {
    let mut parts = Vec::new();
    if let Some([start, end]) = subset.frames {
        parts.push(format!("frames {start}..{end}"));
    }
    if let Some(limit) = subset.limit {
        parts.push(format!("at most {} per sequence", count(limit, "frame")));
    }
    if !subset.subjects.is_empty() {
        parts.push(format!("subjects {}", subset.subjects.join(", ")));
    }
    if !subset.variants.is_empty() {
        parts.push(format!("variants {}", subset.variants.join(", ")));
    }
    format!("Partial: {}", parts.join("; "))
}

/// Where the avatars of a variant come from that is read from files: name and digest of each, and what was fitted instead.
/// None for a variant that is made here.
pub(super) fn avatar_file(plan: &Plan, variant: &Variant, jobs: &[&Job]) -> Option<String> {
    let (AvatarRecipe::File { .. } | AvatarRecipe::Renders { .. }) = variant.avatar else { return None };
    let mut subjects_by_origin: Vec<(String, Vec<&str>)> = Vec::new();
    for job in jobs {
        let avatar = job.variants.iter().find(|own| own.id == variant.id).map(|own| own.avatar.as_str())?;
        let origin = origin(&plan.avatar(avatar)?.source);
        let known = subjects_by_origin.iter_mut().find(|(other, _)| *other == origin);
        match known {
            Some((_, subjects)) if subjects.contains(&job.subject.as_str()) => {}
            Some((_, subjects)) => subjects.push(&job.subject),
            None => subjects_by_origin.push((origin, vec![&job.subject])),
        }
    }
    let clauses: Vec<String> = subjects_by_origin
        .iter()
        .map(|(origin, subjects)| format!("{}: {origin}", subjects.join(", ")))
        .collect();
    (!clauses.is_empty()).then(|| format!("Avatar of {}: {}", variant.label, clauses.join("; ")))
}

/// Where an avatar comes from that may be a file.
fn origin(source: &AvatarSource) -> String {
    match source {
        AvatarSource::File { path, digest, notes, .. } => {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
            let name = name.replace(char::is_control, "\u{fffd}");
            let short = digest.get(..12).unwrap_or(digest);
            let notes: String = notes.iter().map(|note| format!(", {note}")).collect();
            format!("the file {name} (SHA-256 {short}{notes})")
        }
        AvatarSource::Renders(renders) => {
            let name = renders.folder.to_string_lossy().replace(char::is_control, "\u{fffd}");
            let time = renders.milliseconds.map_or(String::new(), |ms| format!(", {ms} ms per frame"));
            let size = renders.bytes.map_or(String::new(), |bytes| format!(", {bytes} bytes"));
            let others = renders.left_over.as_ref().map_or(String::new(), |others| format!("; {others}"));
            let others = others.replace(char::is_control, "\u{fffd}");
            format!(
                "rendered by another program, the folder {name} ({}{size}{time}{others})",
                count(renders.frames.len(), "image")
            )
        }
        AvatarSource::Missing { problem } => format!("none: {problem}"),
        AvatarSource::Fit { fit, .. } => format!("no file, so fitted by {}", fit.options.recipe.id),
        AvatarSource::Surface { .. } | AvatarSource::Textured { .. } => "made here".to_owned(),
    }
}

/// `1 frame`, `2 frames`.
pub(super) fn count(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}
