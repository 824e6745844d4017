//! Less to store: parameters in 16 bits, fewer splats.

use super::production::angles_of;
use super::rotations::stored_short;
use super::{Bench, subset};
use crate::trade::exact::{degrees, stock};
use crate::trade::{Error, Outcome, Sweep, SweepRow, Unit};
use glam::Vec3;
use half::f16;
use half::slice::HalfFloatSliceExt;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, PosedBody};
use skinsplat_posing::{BoundAvatar, pose};
use skinsplat_render::definition::{self, Cutoffs};

/// A group of parameters that may be stored in 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Means,
    Rotations,
    Scales,
    Opacities,
    Sh,
    Weights,
}

impl Part {
    const ALL: [Self; 6] =
        [Self::Means, Self::Rotations, Self::Scales, Self::Opacities, Self::Sh, Self::Weights];

    fn name(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::Rotations => "rotations",
            Self::Scales => "scales",
            Self::Opacities => "opacities",
            Self::Sh => "sh",
            Self::Weights => "weights",
        }
    }

    /// Numbers that it has.
    fn numbers(self, avatar: &Avatar) -> usize {
        let n = avatar.gaussians.len();
        match self {
            Self::Means | Self::Scales => 3 * n,
            Self::Rotations => 4 * n,
            Self::Opacities => n,
            Self::Sh => 3 * avatar.gaussians.sh.len(),
            Self::Weights => match &avatar.binding {
                Binding::Vertex(weights) => (0..weights.len()).map(|i| weights.row(i).1.len()).sum(),
                // Barycentric coordinates and an offset.
                Binding::Face(_) => 4 * n,
                Binding::Static => 0,
            },
        }
    }
}

fn short(v: f32) -> f32 {
    f16::from_f32(v).to_f32()
}

/// The avatar as it is read back when these parts were stored in 16 bits.
fn read_back(avatar: &Avatar, parts: &[Part], joints: usize) -> Result<Avatar, Error> {
    let mut read = avatar.clone();
    let own = |v: &mut Vec3| *v = Vec3::from_array(v.to_array().map(short));
    for part in parts {
        let Gaussians { means, rotations, log_scales, opacity_logits, sh, .. } = &mut read.gaussians;
        match part {
            Part::Means => means.iter_mut().for_each(own),
            Part::Scales => log_scales.iter_mut().for_each(own),
            Part::Rotations => rotations.iter_mut().for_each(|q| *q = q.map(short)),
            Part::Opacities => opacity_logits.iter_mut().for_each(|v| *v = short(*v)),
            Part::Sh => sh.iter_mut().for_each(|c| *c = c.map(short)),
            Part::Weights => match &mut read.binding {
                Binding::Vertex(weights) => *weights = stored_short(weights, joints)?,
                Binding::Face(binding) => {
                    binding.barycentric.iter_mut().for_each(|b| *b = b.map(short));
                    binding.offsets.iter_mut().for_each(|v| *v = short(*v));
                }
                Binding::Static => {}
            },
        }
    }
    Ok(read)
}

/// Parameters stored in 16 bits, part by part and all together.
pub(super) fn storage(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let joints = stage.rig.body.skeleton.num_joints();
    let mut choices: Vec<(String, &[Part])> = vec![("f32".to_owned(), &[])];
    choices.extend(Part::ALL.iter().map(|part| (format!("f16 {}", part.name()), std::slice::from_ref(part))));
    choices.push(("f16 all but means".to_owned(), &Part::ALL[1..]));
    choices.push(("f16 all".to_owned(), &Part::ALL));
    let n = stage.avatar.gaussians.len() as f64;
    let numbers = |parts: &[Part]| parts.iter().map(|part| part.numbers(&stage.avatar) as f64).sum::<f64>();
    let full = 4.0 * numbers(&Part::ALL);
    let mut rows = Vec::new();
    for (m, motion) in stage.motions.iter().enumerate() {
        rows.push(SweepRow {
            motion: motion.id,
            choice: vec!["f64".to_owned()],
            outcome: Err(
                "the parameters given are f32: twice the bytes would hold the same values".to_owned()
            ),
            note: String::new(),
        });
        for (name, parts) in &choices {
            let avatar = read_back(&stage.avatar, parts, joints)?;
            let bound = BoundAvatar::new(&avatar, &stage.rig.body)?;
            let (mut angles, mut images) = (Vec::new(), Vec::new());
            for shot in &motion.shots {
                let body = PosedBody::new(&stage.rig.body, &shot.pose)?;
                let posed = pose(&bound, &body, &stock())?;
                angles.push(angles_of(bench, shot, posed.rotations.as_deref().unwrap_or_default()));
                images.push(stage.image(&posed.as_posed(), &shot.camera)?);
            }
            let bytes = (full - 2.0 * numbers(parts)) / n;
            rows.push(SweepRow {
                motion: motion.id,
                choice: vec![name.clone()],
                outcome: Ok(Outcome {
                    time: Some(decoding(bench, parts)),
                    bytes: Some(bytes),
                    degrees: degrees(angles),
                    fidelity: Some(bench.fidelity(m, &images)?),
                }),
                note: String::new(),
            });
        }
    }
    Ok(Sweep {
        id: "storage",
        title: "Storage of parameters",
        about: "Parameters stored in 16-bit floats and computed with in f32. Bytes count numbers, not indices of joints; the \
                time is that of reading all parameters into f32, once per avatar. The front is judged by bytes."
            .to_owned(),
        axes: vec!["Storage"],
        unit: Unit::PerGaussian,
        by_bytes: true,
        rows,
    })
}

/// Time to copy the parameters into f32, from 16 bits where a part is stored so.
fn decoding(bench: &Bench, parts: &[Part]) -> crate::trade::Spread {
    let avatar = &bench.stage.avatar;
    let stored: Vec<(Vec<f16>, Vec<f32>)> = Part::ALL
        .iter()
        .map(|part| {
            let count = part.numbers(avatar);
            if parts.contains(part) {
                (vec![f16::from_f32(0.5); count], Vec::new())
            } else {
                (Vec::new(), vec![0.5; count])
            }
        })
        .collect();
    let mut decoded: Vec<f32> = Vec::new();
    let time = bench.time(|| {
        decoded.clear();
        for (narrow, wide) in &stored {
            let start = decoded.len();
            decoded.resize(start + narrow.len(), 0.0);
            narrow.convert_to_f32_slice(&mut decoded[start..]);
            decoded.extend_from_slice(wide);
        }
        decoded.last().copied()
    });
    time.per(avatar.gaussians.len())
}

/// Shares of the Gaussians that are kept, per cent.
const KEPT: [usize; 5] = [90, 75, 50, 25, 10];

/// Fewer splats, the least opaque or those that add least to the training images left out.
pub(super) fn splats(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let joints = stage.rig.body.skeleton.num_joints();
    let gaussians = &stage.avatar.gaussians;
    let n = gaussians.len();
    let opacities: Vec<f64> = gaussians.opacities().iter().map(|&o| f64::from(o)).collect();
    let spread = opacities.iter().fold([1.0_f64, 0.0], |[low, high], &o| [low.min(o), high.max(o)]);
    let flat = spread[1] - spread[0] < 1e-6;
    let contributions = contributions(bench)?;
    let mut rows = Vec::new();
    let rankings = [("contribution", &contributions), ("opacity", &opacities)];
    let pruned = rankings.iter().flat_map(|&(by, ranks)| KEPT.map(|share| (by, ranks, share)));
    for (by, ranks, share) in std::iter::once(("all", &opacities, 100)).chain(pruned) {
        let choice = vec![by.to_owned(), format!("{share} %")];
        if by == "opacity" && flat {
            for motion in &stage.motions {
                let problem = "all opacities are equal: nothing to rank by".to_owned();
                let (choice, note) = (choice.clone(), String::new());
                rows.push(SweepRow { motion: motion.id, choice, outcome: Err(problem), note });
            }
            continue;
        }
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| ranks[b].total_cmp(&ranks[a]).then(a.cmp(&b)));
        order.truncate((n * share).div_ceil(100).max(1));
        order.sort_unstable();
        let bound = BoundAvatar::new(&subset(&stage.avatar, &order, joints)?, &stage.rig.body)?;
        for (m, motion) in stage.motions.iter().enumerate() {
            let mut images = Vec::new();
            for shot in &motion.shots {
                let body = PosedBody::new(&stage.rig.body, &shot.pose)?;
                let posed = pose(&bound, &body, &stock())?;
                images.push(stage.image(&posed.as_posed(), &shot.camera)?);
            }
            let time = bench.frame_time(&bound, &stock(), &motion.shots[0])?;
            let fidelity = Some(bench.fidelity(m, &images)?);
            rows.push(SweepRow {
                motion: motion.id,
                choice: choice.clone(),
                outcome: Ok(Outcome { time: Some(time), fidelity, ..Outcome::default() }),
                note: format!("{} Gaussians", order.len()),
            });
        }
    }
    Ok(Sweep {
        id: "splats",
        title: "Number of splats",
        about: "The most opaque Gaussians, or those that add most to some training frames (Σ alpha · transmittance), without \
                fitting the rest again; against the exact images of all. The time is that of posing and drawing."
            .to_owned(),
        axes: vec!["Kept by", "Kept"],
        unit: Unit::PerFrame,
        by_bytes: false,
        rows,
    })
}

/// What each Gaussian adds to the training frames.
fn contributions(bench: &Bench) -> Result<Vec<f64>, Error> {
    let stage = bench.stage;
    let mut sums = vec![0.0; stage.avatar.gaussians.len()];
    for (at, camera) in &stage.training {
        let body = PosedBody::new(&stage.rig.body, at)?;
        let posed = pose(&stage.bound, &body, &stock())?;
        let drawn = definition::draw(&posed.as_posed(), &stage.view(camera), Cutoffs::STOCK)?;
        sums.iter_mut().zip(&drawn.contributions).for_each(|(sum, share)| *sum += share);
    }
    Ok(sums)
}
