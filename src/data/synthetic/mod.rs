//! The dataset that needs no file.

mod atlas;
mod field;
mod figure;
mod flesh;
mod lighting;
mod material;
mod motion;
mod noise;
mod parameters;
mod skeleton;
mod stage;
mod surface;
mod truth;
mod weights;

pub use parameters::{
    ArmShape, Capture, FigureShape, GENERATOR_VERSION, Lights, Look, Motion, Parameters, Pattern, Rig,
};

/// scratch
pub struct Scratch { m: truth::Model, p: Parameters }
impl Scratch {
    pub fn new(p: &Parameters) -> Self {
        p.validate().expect("x");
        let m = truth::Model { figure: figure::build(p).expect("x"), material: material::Material::new(p.look, p.seed), lights: p.lights, rig: p.rig, samples: p.samples };
        Self { m, p: p.clone() }
    }
    pub fn body(&self) -> &crate::scene::RestBody { &self.m.figure.body }
    pub fn draw(&self, track: usize, n: u32, k: u32, cam: usize) -> crate::scene::Image {
        use motion::Track::*;
        let tr = [Turn, Drill, Gesture, Twist, Bend, Fingers, ArmTurn, ArmTwist, ArmBend][track];
        let poses = motion::poses(tr, &self.p.motion, self.p.seed, &self.m.figure.body.skeleton, n);
        let cams = stage::cameras(&self.p, stage::Role::Train);
        let t = std::time::Instant::now();
        let d = self.m.draw(&poses[k as usize], &cams[cam]).expect("x");
        println!("{:?}", t.elapsed());
        d.over([1.0;3]).image
    }
}
