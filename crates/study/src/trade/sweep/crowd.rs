//! One avatar and six at once.

use super::{Bench, with_degree};
use crate::trade::exact::stock;
use crate::trade::{Error, Fidelity, Outcome, Sweep, SweepRow, Unit, clock};
use glam::DVec3;
use skinsplat_core::math::average::{Solver, Start};
use skinsplat_core::scene::{Avatar, Camera, OwnedPosed, Pose, PosedBody};
use skinsplat_posing::{
    BoundAvatar, ColourChoice, PoseOptions, Poser, PosingError, RotationChoice, Strategy,
};
use skinsplat_render::splat::Renderer;

/// Ways to pose a crowd: name, rotation solver, colour, degree (at most the avatar's own).
fn choices() -> [(&'static str, Strategy, usize); 6] {
    let power = RotationChoice::QuaternionAverage(Solver::Power { steps: 15, start: Start::Heaviest });
    let nlerp = RotationChoice::QuaternionAverage(Solver::Nlerp);
    let plain = Strategy { colour: ColourChoice::None, ..stock() };
    [
        ("closed-form, SH rotated", stock(), 3),
        (
            "closed-form, direction canonicalised",
            Strategy { colour: ColourChoice::ViewRotation, ..stock() },
            3,
        ),
        ("power-15, SH rotated", Strategy { rotation: power, ..stock() }, 3),
        ("power-15, degree 0", Strategy { rotation: power, ..plain }, 0),
        ("closed-form, degree 0", plain, 0),
        ("nlerp, degree 0", Strategy { rotation: nlerp, ..plain }, 0),
    ]
}

/// One and six avatars, posed and drawn.
pub(super) fn avatars(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let mut flat = stage.bound.clone();
    let gaussians = with_degree(&stage.avatar.gaussians, 0);
    flat.update(&Avatar { gaussians, binding: stage.avatar.binding.clone() })?;
    let mut rows = Vec::new();
    for motion in &stage.motions {
        for count in [1, 6] {
            let camera = &motion.shots[0].camera;
            let poses: Vec<Pose> = (0..count)
                .map(|i| placed(&motion.shots[i % motion.shots.len()].pose, camera, bench, i, count))
                .collect();
            let bodies: Vec<PosedBody> =
                poses.iter().map(|at| PosedBody::new(&stage.rig.body, at)).collect::<Result<_, _>>()?;
            let (mut renderer, mut poser) = (Renderer::new(), Poser::new());
            let exact = posed(&mut poser, &stage.bound, &bodies, &stock())?;
            let view = stage.view(camera);
            let exact = renderer.render(&exact.as_posed(), &view)?.image.clone();
            for (name, strategy, degree) in choices() {
                let bound = if degree == 0 { &flat } else { &stage.bound };
                let drawn = posed(&mut poser, bound, &bodies, &strategy)?;
                let image = &renderer.render(&drawn.as_posed(), &view)?.image;
                let fidelity = Some(Fidelity::between([(image, &exact)])?);
                let repeats = stage.options.repeats;
                let time = bench.pool.install(|| {
                    clock::time(repeats, || {
                        posed(&mut poser, bound, &bodies, &strategy)
                            .is_ok_and(|all| renderer.render(&all.as_posed(), &view).is_ok())
                    })
                });
                let engine = name == "power-15, degree 0";
                rows.push(SweepRow {
                    motion: motion.id,
                    choice: vec![name.to_owned(), count.to_string()],
                    outcome: Ok(Outcome { time: Some(time), fidelity, ..Outcome::default() }),
                    note: if engine { "the paper's engine path" } else { "" }.to_owned(),
                });
            }
        }
    }
    Ok(Sweep {
        id: "avatars",
        title: "Avatars at once",
        about: "One frame of one or of six avatars, posed and drawn together, against the closed form with rotated SH. `power-15, \
                degree 0` is the paper's engine path."
            .to_owned(),
        axes: vec!["Way", "Avatars"],
        unit: Unit::PerFrame,
        by_bytes: false,
        rows,
    })
}

/// A pose moved to its place among `count`: two rows of three before the camera, further away than one alone.
fn placed(at: &Pose, camera: &Camera, bench: &Bench, i: usize, count: usize) -> Pose {
    if count == 1 {
        return at.clone();
    }
    let vertices = &bench.stage.rig.body.vertices;
    let low = vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = (high - low).max_element().max(0.0);
    let axis = |row: usize| camera.camera_from_world.row(row).truncate().normalize_or_zero();
    let across = (i % 3) as f64 - 1.0;
    let away = 1.2 + 0.6 * (i / 3) as f64;
    let mut pose = at.clone();
    pose.translation += size * (0.6 * across * axis(0) + away * axis(2));
    pose
}

/// All avatars of a frame as one set of Gaussians.
fn posed(
    poser: &mut Poser,
    bound: &BoundAvatar,
    bodies: &[PosedBody<'_>],
    strategy: &Strategy,
) -> Result<OwnedPosed, PosingError> {
    let options = PoseOptions::default();
    let mut all = poser.pose(bound, &bodies[0], strategy, &options)?.into_owned();
    for body in &bodies[1..] {
        let one = poser.pose(bound, body, strategy, &options)?;
        all.means.extend_from_slice(one.means);
        all.factors.extend_from_slice(one.factors);
        all.opacities.extend_from_slice(one.opacities);
        all.sh.extend_from_slice(one.sh);
        if let (Some(all), Some(one)) = (&mut all.view_frames, one.view_frames) {
            all.extend_from_slice(one);
        }
        all.rotations = None;
    }
    Ok(all)
}
