//! The sweeps, and what they share: exact images, one thread to measure on.

mod crowd;
mod images;
mod production;
mod rotations;
mod storage;

use super::exact::Shot;
use super::{Error, Fidelity, Spread, Stage, Sweep, clock};
use skinsplat_core::scene::{
    Avatar, Binding, FaceBinding, Gaussians, Image, OwnedPosed, PosedBody, SkinWeights,
};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy};
use skinsplat_render::splat::Renderer;

/// Ids of all sweeps, in reading order.
pub const SWEEPS: [&str; 10] = [
    "solver",
    "influences",
    "precision",
    "strategy",
    "colour",
    "storage",
    "splats",
    "cutoffs",
    "resolution",
    "avatars",
];

/// Measures the sweeps of these ids, in their order. `watch` hears the id of each before it begins.
///
/// # Errors
/// An id that no sweep has, images that cannot be compared, a system without threads. What a sweep cannot run on this
/// avatar is a row that says so.
pub fn measure(stage: &Stage, ids: &[&str], watch: &mut dyn FnMut(&str)) -> Result<Vec<Sweep>, Error> {
    let bench = Bench::new(stage)?;
    let mut sweeps = Vec::with_capacity(ids.len());
    for &id in ids {
        watch(id);
        sweeps.push(match id {
            "solver" => rotations::solvers(&bench)?,
            "influences" => rotations::influences(&bench)?,
            "precision" => rotations::precision(&bench)?,
            "strategy" => production::strategies(&bench)?,
            "colour" => production::colours(&bench)?,
            "storage" => storage::storage(&bench)?,
            "splats" => storage::splats(&bench)?,
            "cutoffs" => images::cutoffs(&bench)?,
            "resolution" => images::resolutions(&bench)?,
            "avatars" => crowd::avatars(&bench)?,
            other => {
                return Err(Error::Subject {
                    subject: "sweep".to_owned(),
                    problem: format!("no `{other}`"),
                    expected: format!("one of {}", SWEEPS.join(", ")),
                });
            }
        });
    }
    Ok(sweeps)
}

/// A stage with its exact images and a thread to measure on.
struct Bench<'a> {
    stage: &'a Stage,
    /// Of one thread.
    pool: rayon::ThreadPool,
    /// Exact images per motion and shot, by the program's rasterizer.
    exact: [Vec<Image>; 2],
}

impl<'a> Bench<'a> {
    fn new(stage: &'a Stage) -> Result<Self, Error> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let mut bench = Self { stage, pool, exact: [Vec::new(), Vec::new()] };
        for m in 0..2 {
            bench.exact[m] = bench.drawn(m, |shot| shot.exactly(&stage.rig, &stage.avatar.gaussians))?;
        }
        Ok(bench)
    }

    /// Every shot of a motion, as `posed` poses it.
    fn drawn(&self, motion: usize, mut posed: impl FnMut(&Shot) -> OwnedPosed) -> Result<Vec<Image>, Error> {
        let draw = |shot: &Shot| -> Result<Image, Error> {
            Ok(self.stage.image(&posed(shot).as_posed(), &shot.camera)?)
        };
        self.stage.motions[motion].shots.iter().map(draw).collect()
    }

    /// How like the exact images of a motion these are.
    fn fidelity(&self, motion: usize, images: &[Image]) -> Result<Fidelity, Error> {
        Fidelity::between(images.iter().zip(&self.exact[motion]))
    }

    /// Times work on one thread.
    fn time<T: Send>(&self, work: impl FnMut() -> T + Send) -> Spread {
        let repeats = self.stage.options.repeats;
        self.pool.install(|| clock::time(repeats, work))
    }

    /// Time to pose and draw one shot, seconds per frame, on one thread.
    fn frame_time(&self, bound: &BoundAvatar, strategy: &Strategy, shot: &Shot) -> Result<Spread, Error> {
        let body = PosedBody::new(&self.stage.rig.body, &shot.pose)?;
        let (mut renderer, mut poser, options) = (Renderer::new(), Poser::new(), PoseOptions::default());
        let view = self.stage.view(&shot.camera);
        renderer.render(&poser.pose(bound, &body, strategy, &options)?, &view)?;
        Ok(self.time(|| {
            let posed = poser.pose(bound, &body, strategy, &options);
            posed.is_ok_and(|posed| renderer.render(&posed, &view).is_ok())
        }))
    }
}

/// The Gaussians with the SH bands up to a degree.
fn with_degree(gaussians: &Gaussians, degree: usize) -> Gaussians {
    let (own, kept) = (gaussians.sh_count(), (degree + 1).pow(2));
    let sh = gaussians.sh.chunks(own).flat_map(|c| &c[..kept.min(own)]).copied().collect();
    Gaussians { sh_degree: degree.min(gaussians.sh_degree), sh, ..gaussians.clone() }
}

/// The avatar of these Gaussians alone, in this order.
pub(super) fn subset(avatar: &Avatar, kept: &[usize], joints: usize) -> Result<Avatar, Error> {
    let from = &avatar.gaussians;
    let count = from.sh_count();
    let gaussians = Gaussians {
        means: kept.iter().map(|&i| from.means[i]).collect(),
        rotations: kept.iter().map(|&i| from.rotations[i]).collect(),
        log_scales: kept.iter().map(|&i| from.log_scales[i]).collect(),
        opacity_logits: kept.iter().map(|&i| from.opacity_logits[i]).collect(),
        sh_degree: from.sh_degree,
        sh: kept.iter().flat_map(|&i| &from.sh[i * count..(i + 1) * count]).copied().collect(),
    };
    let binding = match &avatar.binding {
        Binding::Static => Binding::Static,
        Binding::Vertex(weights) => {
            let row = |&i: &usize| {
                let (joints, weights) = weights.row(i);
                joints.iter().zip(weights).map(|(&j, &w)| (usize::from(j), w)).collect::<Vec<_>>()
            };
            Binding::Vertex(SkinWeights::from_rows(kept.iter().map(row), joints)?)
        }
        Binding::Face(binding) => Binding::Face(FaceBinding {
            faces: kept.iter().map(|&i| binding.faces[i]).collect(),
            barycentric: kept.iter().map(|&i| binding.barycentric[i]).collect(),
            offsets: kept.iter().map(|&i| binding.offsets[i]).collect(),
        }),
    };
    Ok(Avatar { gaussians, binding })
}
