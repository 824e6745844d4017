//! One function per saving.

use super::super::clock::in_turns;
use super::super::sweep::subset;
use super::scene::{Options, Scene};
use super::scores;
use super::{Same, Saving};
use crate::trade::Error;
use skinsplat_core::math::rotation::angle_between;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{Avatar, Camera, Image, OwnedPosed, Pose, PosedBody, RestBody};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, PosingError, Strategy, pose};
use skinsplat_render::View;
use skinsplat_render::splat::Renderer;
use std::hint::black_box;

/// Largest difference of a colour value between the two ways of turning SH: rounding of `f32` only.
const SAME_COLOUR: f64 = 2e-5;

/// Degrees between solvers that are exact: rounding of `f32` only.
const SAME_ROTATION: f64 = 0.02;

pub(super) fn all(scene: &Scene, options: &Options) -> Result<Vec<Saving>, Error> {
    let bench = Bench::new(scene, options)?;
    Ok(vec![
        bench.unread_joints()?,
        bench.few_bones()?,
        bench.zero_bands(1)?,
        bench.zero_bands(0)?,
        bench.view_direction()?,
        bench.unseen()?,
        bench.frames()?,
        scores::ssim(&bench)?,
        scores::lpips(&bench)?,
    ])
}

/// The avatar in its poses.
pub(super) struct Bench<'a> {
    pub(super) scene: &'a Scene,
    pub(super) options: &'a Options,
    pub(super) bound: BoundAvatar,
    pub(super) bodies: Vec<PosedBody<'a>>,
    pub(super) cameras: Vec<&'a Camera>,
}

pub(super) fn strategy(spec: &str) -> Result<Strategy, PosingError> {
    spec.parse()
}

/// The largest difference of two images' values.
fn difference(a: &Image, b: &Image) -> f64 {
    let values = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
    values.map(|(x, y)| f64::from((x - y).abs())).fold(0.0, f64::max)
}

fn compared(largest: f64, allowed: f64, of: &'static str) -> Same {
    if largest <= allowed {
        Same::Within { largest, allowed, of }
    } else {
        Same::Different { largest, allowed, of }
    }
}

/// Bits, for values that claim to be the same.
pub(super) fn identical(largest: f64, same: bool, of: &'static str) -> Same {
    if same { Same::Identical } else { Same::Different { largest, allowed: 0.0, of } }
}

/// The largest angle between the drawn rotations, degrees.
fn turned(a: &OwnedPosed, b: &OwnedPosed) -> f64 {
    let pairs = a.rotations.iter().flatten().zip(b.rotations.iter().flatten());
    pairs.map(|(p, q)| angle_between(p.map(f64::from), q.map(f64::from)).to_degrees()).fold(0.0, f64::max)
}

impl<'a> Bench<'a> {
    fn new(scene: &'a Scene, options: &'a Options) -> Result<Self, Error> {
        let body: &RestBody = &scene.test.body;
        let frames = scene.frames.iter().map(|&frame| &scene.test.frames[frame]);
        let bodies = frames.clone().map(|frame| PosedBody::new(body, &scene.test.poses[frame.pose]));
        Ok(Self {
            scene,
            options,
            bound: BoundAvatar::new(&scene.avatar, body)?,
            bodies: bodies.collect::<Result<_, _>>()?,
            cameras: frames.map(|frame| &scene.test.cameras[frame.camera]).collect(),
        })
    }

    fn poses(&self) -> impl Iterator<Item = &'a Pose> {
        let Scene { test, frames, .. } = self.scene;
        frames.iter().map(|&frame| &test.poses[test.frames[frame].pose])
    }

    /// Times two ways of handling every pose, with reused memory, and compares what came out.
    fn posing(
        &self,
        what: String,
        mut without: impl FnMut(&PosedBody<'_>, &mut Poser) -> Result<(), PosingError>,
        mut with: impl FnMut(&PosedBody<'_>, &mut Poser) -> Result<(), PosingError>,
        result: Same,
    ) -> Result<Saving, Error> {
        let (mut first, mut second) = (Poser::new(), Poser::new());
        let [without, with] = in_turns(
            self.options.runs,
            || self.bodies.iter().try_for_each(|body| without(body, &mut first)),
            || self.bodies.iter().try_for_each(|body| with(body, &mut second)),
        )?;
        let [without, with] = [without, with].map(|time| time.per(self.bodies.len()));
        Ok(Saving { what, unit: "pose", without, with, result })
    }

    /// Poses into memory of before.
    fn repose(
        &self,
        body: &PosedBody<'_>,
        strategy: &Strategy,
        poser: &mut Poser,
    ) -> Result<(), PosingError> {
        poser.pose(&self.bound, body, strategy, &PoseOptions::default()).map(|posed| drop(black_box(posed)))
    }

    /// Two strategies.
    fn strategies(&self, what: String, without: Strategy, with: Strategy) -> Result<Saving, Error> {
        let mut largest = 0.0f64;
        for body in &self.bodies {
            let [a, b] = [&without, &with].map(|strategy| pose(&self.bound, body, strategy));
            largest = largest.max(turned(&a?, &b?));
        }
        let run = |strategy: Strategy| {
            move |body: &PosedBody<'_>, poser: &mut Poser| self.repose(body, &strategy, poser)
        };
        self.posing(what, run(without), run(with), compared(largest, SAME_ROTATION, "degrees"))
    }

    /// Joints whose rotation no Gaussian reads: the upper half of the avatar by itself.
    fn unread_joints(&self) -> Result<Saving, Error> {
        let strategy = strategy("quaternion-average")?;
        let body = &*self.scene.test.body;
        let means = &self.scene.avatar.gaussians.means;
        let middle = means.iter().map(|mean| mean.y).sum::<f32>() / means.len() as f32;
        let kept: Vec<usize> = (0..means.len()).filter(|&i| means[i].y > middle).collect();
        let bust = subset(&self.scene.avatar, &kept, body.skeleton.num_joints())?;
        let bound = BoundAvatar::new(&bust, body)?;
        let read = bound.joints_read(&strategy);
        let some = |pose| PosedBody::with_rotations(body, pose, |joint| read[joint]);
        let mut same = true;
        for (at, full) in self.poses().zip(&self.bodies) {
            same &= pose(&bound, full, &strategy)? == pose(&bound, &some(at)?, &strategy)?;
        }
        let [without, with] = in_turns(
            self.options.runs,
            || self.poses().try_for_each(|pose| PosedBody::new(body, pose).map(|body| drop(black_box(body)))),
            || self.poses().try_for_each(|pose| some(pose).map(|body| drop(black_box(body)))),
        )?;
        let [without, with] = [without, with].map(|time| time.per(self.bodies.len()));
        let (unread, all) = (read.iter().filter(|read| !**read).count(), read.len());
        let what = format!(
            "no polar decomposition for the {unread} of {all} joints that no Gaussian of a bust reads"
        );
        Ok(Saving { what, unit: "pose", without, with, result: identical(f64::NAN, same, "posed Gaussians") })
    }

    /// One bone and two bones by closed form, more by repeated squaring, against an eigenvalue problem each.
    fn few_bones(&self) -> Result<Saving, Error> {
        let what = "one and two bones by closed form, not by an eigenvalue problem; SH left alone".to_owned();
        self.strategies(
            what,
            strategy("quaternion-average+rotation=eigen+colour=none")?,
            strategy("quaternion-average+colour=none")?,
        )
    }

    /// SH bands that are stored and zero.
    fn zero_bands(&self, degree: usize) -> Result<Saving, Error> {
        let mut avatar: Avatar = self.scene.avatar.clone();
        let count = avatar.gaussians.sh_count();
        for own in avatar.gaussians.sh.chunks_exact_mut(count) {
            own[sh::count(degree)..].fill([0.0; 3]);
        }
        let stored = BoundAvatar::new(&avatar, &self.scene.test.body)?;
        let needed = stored.clone().without_zero_bands();
        let what = format!(
            "SH bands that are zero dropped: degree {degree} stored as {}",
            avatar.gaussians.sh_degree
        );
        self.images(
            what,
            (&stored, "quaternion-average", false),
            (&needed, "quaternion-average", false),
            &self.cameras,
            None,
        )
    }

    /// The view direction turned back, where a pose is seen once.
    fn view_direction(&self) -> Result<Saving, Error> {
        let what = "a pose seen once: the view direction turned in place of the SH (degree 3)".to_owned();
        let turned = "quaternion-average+colour=view-rotation";
        let allowed = Some(SAME_COLOUR);
        self.images(
            what,
            (&self.bound, "quaternion-average", false),
            (&self.bound, turned, false),
            &self.cameras,
            allowed,
        )
    }

    /// Gaussians outside the view.
    fn unseen(&self) -> Result<Saving, Error> {
        let what = "a close view: Gaussians outside it neither turned nor coloured (degree 3)".to_owned();
        let close = vec![&self.scene.close; self.cameras.len()];
        let bound = &self.bound;
        self.images(
            what,
            (bound, "quaternion-average", false),
            (bound, "quaternion-average", true),
            &close,
            None,
        )
    }

    /// Two ways to the images of all poses: avatar, strategy, and whether posing knows the camera. Bits have to agree
    /// unless a difference is allowed.
    fn images(
        &self,
        what: String,
        without: (&BoundAvatar, &str, bool),
        with: (&BoundAvatar, &str, bool),
        cameras: &[&Camera],
        allowed: Option<f64>,
    ) -> Result<Saving, Error> {
        let mut ways = [Way::new(without)?, Way::new(with)?];
        let (mut largest, mut same) = (0.0f64, true);
        for (body, camera) in self.bodies.iter().zip(cameras) {
            let [a, b] = &mut ways;
            let (a, b) = (a.image(body, camera)?, b.image(body, camera)?);
            largest = largest.max(difference(&a, &b));
            same &= a == b;
        }
        let [a, b] = &mut ways;
        let run = |way: &mut Way<'_>| {
            self.bodies
                .iter()
                .zip(cameras)
                .try_for_each(|(body, camera)| way.image(body, camera).map(|i| drop(black_box(i))))
        };
        let [without, with] =
            in_turns(self.options.runs, || run(a), || run(b))?.map(|time| time.per(self.bodies.len()));
        let result = match allowed {
            None => identical(largest, same, "colour"),
            Some(allowed) => compared(largest, allowed, "colour"),
        };
        Ok(Saving { what, unit: "frame, posed and rendered", without, with, result })
    }

    /// True images that are made when their frame is scored, not when a sequence is loaded.
    fn frames(&self) -> Result<Saving, Error> {
        let (test, wanted) = (&self.scene.test, self.scene.frames[0]);
        let before = test.truth(wanted)?;
        let after = test.selected(&[wanted])?.truth(0)?;
        let some: &[usize] = &self.scene.frames;
        let [without, with] = in_turns(
            1,
            || some.iter().try_for_each(|&frame| test.truth(frame).map(|truth| drop(black_box(truth)))),
            || test.truth(wanted).map(|truth| drop(black_box(truth))),
        )?;
        let what = format!("one frame asked for: true images of {} others not made", some.len() - 1);
        Ok(Saving { what, unit: "run", without, with, result: identical(f64::NAN, before == after, "image") })
    }
}

/// A way to an image.
struct Way<'a> {
    bound: &'a BoundAvatar,
    strategy: Strategy,
    knows_camera: bool,
    poser: Poser,
    renderer: Renderer,
}

impl<'a> Way<'a> {
    fn new((bound, spec, knows_camera): (&'a BoundAvatar, &str, bool)) -> Result<Self, PosingError> {
        let (poser, renderer) = (Poser::new(), Renderer::new());
        Ok(Self { bound, strategy: strategy(spec)?, knows_camera, poser, renderer })
    }

    fn image(&mut self, body: &PosedBody<'_>, camera: &Camera) -> Result<Image, PosingError> {
        let seen_by = self.knows_camera.then_some(camera);
        let options = PoseOptions { seen_by, ..PoseOptions::default() };
        let posed = self.poser.pose(self.bound, body, &self.strategy, &options)?;
        Ok(self.renderer.render(&posed, &View::new(camera))?.image.clone())
    }
}
