//! The program's own posing, in vector lanes: every rotation choice, and every way to colour.

use super::{Bench, with_degree};
use crate::trade::exact::{Shot, degrees, stock};
use crate::trade::{Degrees, Error, Outcome, Spread, Sweep, SweepRow, Unit};
use skinsplat_core::math::Quaternion;
use skinsplat_core::math::average::{Solver, Start};
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::scene::{Avatar, Image, PosedBody};
use skinsplat_posing::{
    BoundAvatar, ColourChoice, PoseOptions, Poser, PosingError, RotationChoice, Strategy, pose,
};
use skinsplat_render::splat::{Phase, Renderer};
use std::hint::black_box;
use std::time::Instant;

/// Solvers that are posed as strategies, besides the closed form.
const SOLVERS: [Solver; 6] = [
    Solver::ClosedForm,
    Solver::Eigen,
    Solver::Polar,
    Solver::Nlerp,
    Solver::Power { steps: 15, start: Start::Heaviest },
    Solver::Squaring { doublings: 4 },
];

/// Every rotation choice through the program's own posing.
pub(super) fn strategies(bench: &Bench) -> Result<Sweep, Error> {
    let averages = SOLVERS.map(RotationChoice::QuaternionAverage);
    let mut rows = Vec::new();
    for (m, motion) in bench.stage.motions.iter().enumerate() {
        for rotation in averages.into_iter().chain(RotationChoice::named()) {
            let strategy = Strategy { rotation, ..stock() };
            let note = match rotation {
                RotationChoice::DualQuaternion => "means follow the dual quaternions too",
                RotationChoice::FaceFrame(skinsplat_posing::FaceFrame::HahaScaled) => {
                    "means and scales follow the faces too"
                }
                RotationChoice::VertexQuaternions(SignPolicy::NonNegativeW) => "as SplattingAvatar",
                RotationChoice::Lbs(skinsplat_posing::LbsProjection::MatrixToQuaternionRaw) => {
                    "not a rotation: angles are undefined"
                }
                _ => "",
            };
            rows.push(SweepRow {
                motion: motion.id,
                choice: vec![rotation.to_string()],
                outcome: posed(bench, m, &bench.stage.bound, &strategy)?,
                note: note.to_owned(),
            });
        }
    }
    Ok(Sweep {
        id: "strategy",
        title: "Rotation strategy",
        about: "All Gaussians of a frame posed by the program, SH rotated: what a strategy costs where 8 Gaussians share an \
                instruction. The closed form and the matrix projections use lanes; other solvers run one by one."
            .to_owned(),
        axes: vec!["Rotation"],
        unit: Unit::PerGaussian,
        by_bytes: false,
        rows,
    })
}

/// Poses with a strategy; what the avatar does not allow is a reason.
fn posed(
    bench: &Bench,
    m: usize,
    bound: &BoundAvatar,
    strategy: &Strategy,
) -> Result<Result<Outcome, String>, Error> {
    let stage = bench.stage;
    let shots = &stage.motions[m].shots;
    let mut angles = Some(Vec::new());
    let mut images: Vec<Image> = Vec::new();
    for shot in shots {
        let body = PosedBody::new(&stage.rig.body, &shot.pose)?;
        let posed = match pose(bound, &body, strategy) {
            Ok(posed) => posed,
            Err(PosingError::NoFaces { .. }) => return Ok(Err("the body has no faces".to_owned())),
            Err(other) => return Err(other.into()),
        };
        angles = angles.zip(posed.rotations.as_ref()).map(|(mut all, rotations)| {
            all.push(angles_of(bench, shot, rotations));
            all
        });
        images.push(stage.image(&posed.as_posed(), &shot.camera)?);
    }
    let body = PosedBody::new(&stage.rig.body, &shots[0].pose)?;
    if strategy.rotation.needs_faces() {
        // Skinning the mesh is shared by everything that reads it.
        body.mesh();
    }
    let (mut poser, options) = (Poser::new(), PoseOptions::default());
    let time =
        bench.time(|| poser.pose(bound, &body, strategy, &options).map(|posed| drop(black_box(posed))));
    let degrees: Option<Degrees> = angles.and_then(degrees);
    Ok(Ok(Outcome {
        time: Some(time.per(bound.len())),
        bytes: None,
        degrees,
        fidelity: Some(bench.fidelity(m, &images)?),
    }))
}

/// Angles of drawn quaternions to the exact ones.
pub(super) fn angles_of(bench: &Bench, shot: &Shot, rotations: &[Quaternion<f32>]) -> Vec<f64> {
    let back = |(i, q): (usize, &Quaternion<f32>)| {
        let drawn = bench.stage.rig.drawn(i, shot.exact[i].quat);
        let angle = skinsplat_core::math::rotation::angle_between(q.map(f64::from), drawn).to_degrees();
        shot.exact[i].unique.then_some(if angle.is_nan() { 180.0 } else { angle })
    };
    rotations.iter().enumerate().filter_map(back).collect()
}

/// Every way to colour at every degree.
pub(super) fn colours(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let own = stage.avatar.gaussians.sh_degree;
    let mut rows = Vec::new();
    for degree in 0..=skinsplat_core::math::sh::MAX_DEGREE {
        let choices: &[ColourChoice] = match degree {
            0 => &[ColourChoice::None],
            _ => &[
                ColourChoice::RotateSh,
                ColourChoice::ViewRotation,
                ColourChoice::ViewBlend,
                ColourChoice::None,
            ],
        };
        let mut bound = stage.bound.clone();
        if degree <= own {
            let gaussians = with_degree(&stage.avatar.gaussians, degree);
            bound.update(&Avatar { gaussians, binding: stage.avatar.binding.clone() })?;
        }
        for (m, motion) in stage.motions.iter().enumerate() {
            for &colour in choices {
                let strategy = Strategy { colour, ..stock() };
                let outcome = if degree <= own {
                    coloured(bench, m, &bound, &strategy).map(Ok)?
                } else {
                    Err(format!("the avatar has SH of degree {own}"))
                };
                let note = match (degree, colour) {
                    (0, _) => "the same for every choice: colours of degree 0 do not depend on the view",
                    (_, ColourChoice::ViewRotation) => {
                        "the canonicalised direction; the same image as rotated SH"
                    }
                    _ => "",
                };
                rows.push(SweepRow {
                    motion: motion.id,
                    choice: vec![colour.to_string(), degree.to_string()],
                    outcome,
                    note: note.to_owned(),
                });
            }
        }
    }
    Ok(Sweep {
        id: "colour",
        title: "Colour",
        about: "SH rotated, the view direction turned back instead (`view-rotation`; `view-blend` with the transposed blend), \
                or neither, at each degree; against the avatar's own degree, rotated. The time is that of posing and of \
                the rasterizer's projection and colour, which is where the two differ."
            .to_owned(),
        axes: vec!["Colour", "Degree"],
        unit: Unit::PerGaussian,
        by_bytes: false,
        rows,
    })
}

/// Images, and the time of posing plus that of the phase in which colours are read.
fn coloured(bench: &Bench, m: usize, bound: &BoundAvatar, strategy: &Strategy) -> Result<Outcome, Error> {
    let stage = bench.stage;
    let shots = &stage.motions[m].shots;
    let mut images = Vec::new();
    for shot in shots {
        let body = PosedBody::new(&stage.rig.body, &shot.pose)?;
        let posed = pose(bound, &body, strategy)?;
        images.push(stage.image(&posed.as_posed(), &shot.camera)?);
    }
    let shot = &shots[0];
    let body = PosedBody::new(&stage.rig.body, &shot.pose)?;
    let times = bench.pool.install(|| {
        let (mut renderer, mut poser, options) = (Renderer::new(), Poser::new(), PoseOptions::default());
        renderer.profile(true);
        let view = stage.view(&shot.camera);
        let mut times = Vec::new();
        for _ in 0..=stage.options.repeats {
            let start = Instant::now();
            let posed = poser.pose(bound, &body, strategy, &options)?;
            let posing = start.elapsed();
            renderer.render(&posed, &view)?;
            times.push((posing + renderer.phase_times().of(Phase::Preprocess)).as_secs_f64().max(1e-9));
        }
        Ok::<_, Error>(times)
    })?;
    // The first has cold caches.
    let time = Spread::of(&times[1..]).per(bound.len());
    Ok(Outcome { time: Some(time), bytes: None, degrees: None, fidelity: Some(bench.fidelity(m, &images)?) })
}
