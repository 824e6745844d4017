//! What an optimiser steps on: the avatar, how a recipe lets it change, and the moments of every group.

use crate::adam::Adam;
use crate::options::Moments;
use crate::recipe::{Free, FreePosition, FreeRotation, FreeScale, Recipe};
use glam::{Quat, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{Avatar, AvatarGradient, Binding, Gaussians};

/// An avatar that is being fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Parameters {
    pub(super) avatar: Avatar,
    /// Where each Gaussian started: what offsets, angles and displacements are measured from.
    pub(super) start: Vec<Origin>,
    /// Mean edge of the mesh's faces, metres: barycentric coordinates times this are metres.
    edge: f32,
    position: Adam,
    /// Face-bound Gaussians: their offsets.
    height: Adam,
    rotation: Adam,
    scale: Adam,
    opacity: Adam,
    colour: Adam,
}

/// Where a Gaussian started.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Origin {
    pub(super) mean: Vec3,
    /// Its axis along the normal of the surface.
    pub(super) normal: Vec3,
    pub(super) rotation: [f32; 4],
    /// Of face-bound Gaussians, metres.
    pub(super) height: f32,
    /// Distance from `mean` along `normal`, metres.
    pub(super) offset: f32,
    /// Angle about `normal` since then, radians.
    pub(super) angle: f32,
    pub(super) log_scale: Vec3,
    pub(super) opacity_logit: f32,
    /// SH coefficient of degree 0.
    pub(super) colour: [f32; 3],
}

/// Learning rates at one iteration.
#[derive(Clone, Copy, Debug)]
pub(super) struct RatesNow {
    pub(super) position: f32,
    pub(super) rotation: f32,
    pub(super) scale: f32,
    pub(super) opacity: f32,
    pub(super) colour: f32,
    pub(super) colour_rest: f32,
}

impl RatesNow {
    /// The rates of a recipe at an iteration out of a number.
    pub(super) fn of(recipe: &Recipe, iteration: u32, iterations: u32) -> Self {
        let rates = &recipe.rates;
        let done = f64::from(iteration) / f64::from(iterations.max(2) - 1);
        let fallen = if rates.position > 0.0 && rates.position_last > 0.0 {
            let (first, last) = (f64::from(rates.position), f64::from(rates.position_last));
            (first * portable::pow(last / first, done)) as f32
        } else {
            rates.position
        };
        let decay = match rates.decay {
            1.0 => 1.0,
            decay => portable::pow(f64::from(decay), done) as f32,
        };
        Self {
            position: fallen,
            rotation: rates.rotation * decay,
            scale: rates.scale * decay,
            opacity: rates.opacity * decay,
            colour: rates.colour * decay,
            colour_rest: rates.colour_rest * decay,
        }
    }
}

impl Origin {
    /// The origins of an avatar's Gaussians as they stand. The third axis of a surface Gaussian is its normal.
    pub(super) fn of(avatar: &Avatar) -> Vec<Self> {
        let gaussians = &avatar.gaussians;
        let rotations = gaussians.unit_rotations();
        let height = |i: usize| match &avatar.binding {
            Binding::Face(binding) => binding.offsets[i],
            Binding::Static | Binding::Vertex(_) => 0.0,
        };
        let origin = |(i, &rotation): (usize, &[f32; 4])| Self {
            mean: gaussians.means[i],
            normal: quat(rotation) * Vec3::Z,
            rotation,
            height: height(i),
            offset: 0.0,
            angle: 0.0,
            log_scale: gaussians.log_scales[i],
            opacity_logit: gaussians.opacity_logits[i],
            colour: gaussians.sh[i * gaussians.sh_count()],
        };
        rotations.iter().enumerate().map(origin).collect()
    }
}

impl Parameters {
    /// Of an avatar before its first iteration; `edge` is the mean edge of the body's faces, metres.
    pub(super) fn new(avatar: Avatar, edge: f32, free: &Free, moments: Moments) -> Self {
        let adam = |len: usize| Adam::new(len, moments);
        let [position, height, rotation, scale, opacity, colour] = Self::lengths(&avatar, free).map(adam);
        Self { start: Origin::of(&avatar), edge, position, height, rotation, scale, opacity, colour, avatar }
    }

    /// Numbers of free parameters: positions, heights over faces, rotations, scales, opacities, colours.
    fn lengths(avatar: &Avatar, free: &Free) -> [usize; 6] {
        let n = avatar.gaussians.len();
        let along = free.position == FreePosition::AlongNormal;
        let (position, height) = match &avatar.binding {
            Binding::Face(_) => (if along { 0 } else { 3 * n }, n),
            Binding::Static | Binding::Vertex(_) => (if along { n } else { 3 * n }, 0),
        };
        let rotation = if free.rotation == FreeRotation::AboutNormal { n } else { 4 * n };
        [position, height, rotation, 3 * n, n, 3 * avatar.gaussians.sh.len()]
    }

    /// True if what belongs together has one length: a checkpoint may say something else.
    pub(super) fn is_for(&self, free: &Free) -> bool {
        let moments =
            [&self.position, &self.height, &self.rotation, &self.scale, &self.opacity, &self.colour];
        let lengths = Self::lengths(&self.avatar, free);
        self.start.len() == self.len() && moments.into_iter().zip(lengths).all(|(adam, len)| adam.is_for(len))
    }

    /// Number of Gaussians.
    pub(super) fn len(&self) -> usize {
        self.avatar.gaussians.len()
    }

    /// One step of every free group.
    pub(super) fn step(&mut self, gradient: &mut AvatarGradient, free: &Free, rates: &RatesNow) {
        self.step_positions(gradient, free, rates.position);
        self.step_rotations(gradient, free, rates.rotation);
        let gaussians = &mut self.avatar.gaussians;
        if free.scale != FreeScale::Fixed {
            if free.scale == FreeScale::InPlane {
                gradient.log_scales.iter_mut().for_each(|g| g.z = 0.0);
            }
            let values = bytemuck::cast_slice_mut(&mut gaussians.log_scales);
            self.scale.step(values, bytemuck::cast_slice(&gradient.log_scales), rates.scale);
            if free.scale_most > 0.0 {
                let most = Vec3::splat(portable::ln(free.scale_most));
                for (log_scale, origin) in gaussians.log_scales.iter_mut().zip(&self.start) {
                    *log_scale = log_scale.min(origin.log_scale + most);
                }
            }
        }
        if free.opacity {
            self.opacity.step(&mut gaussians.opacity_logits, &gradient.opacity_logits, rates.opacity);
        }
        let width = 3 * gaussians.sh_count();
        let rate = |place: usize| if place < 3 { rates.colour } else { rates.colour_rest };
        self.colour.step_rows(gaussians.sh.as_flattened_mut(), gradient.sh.as_flattened(), width, rate);
    }

    fn step_positions(&mut self, gradient: &mut AvatarGradient, free: &Free, rate: f32) {
        let Avatar { gaussians, binding } = &mut self.avatar;
        match (binding, free.position) {
            (_, FreePosition::Fixed) | (Binding::Static, _) => {}
            (Binding::Vertex(_), FreePosition::Free) => {
                let values = bytemuck::cast_slice_mut(&mut gaussians.means);
                self.position.step(values, bytemuck::cast_slice(&gradient.means), rate);
            }
            (Binding::Vertex(_), FreePosition::AlongNormal) => {
                let slopes: Vec<f32> =
                    gradient.means.iter().zip(&self.start).map(|(g, origin)| g.dot(origin.normal)).collect();
                let mut offsets: Vec<f32> = self.start.iter().map(|origin| origin.offset).collect();
                self.position.step(&mut offsets, &slopes, rate);
                let moved = gaussians.means.iter_mut().zip(&mut self.start).zip(offsets);
                for ((mean, origin), offset) in moved {
                    origin.offset = offset;
                    *mean = origin.mean + origin.normal * offset;
                }
            }
            (Binding::Face(binding), position) => {
                self.height.step(&mut binding.offsets, &gradient.offsets, rate);
                if position == FreePosition::Free {
                    // The sum of the coordinates stays: only the part of the derivative along the face counts.
                    for g in &mut gradient.barycentric {
                        let mean = g.iter().sum::<f32>() / 3.0;
                        *g = g.map(|g| g - mean);
                    }
                    let values = binding.barycentric.as_flattened_mut();
                    self.position.step(values, gradient.barycentric.as_flattened(), rate / self.edge);
                    for b in &mut binding.barycentric {
                        let excess = (b.iter().sum::<f32>() - 1.0) / 3.0;
                        *b = b.map(|b| b - excess);
                    }
                }
            }
        }
    }

    fn step_rotations(&mut self, gradient: &AvatarGradient, free: &Free, rate: f32) {
        let rotations = &mut self.avatar.gaussians.rotations;
        match free.rotation {
            FreeRotation::Fixed => {}
            FreeRotation::Quaternion => {
                let slopes = gradient.rotations.as_flattened();
                self.rotation.step(rotations.as_flattened_mut(), slopes, rate);
            }
            FreeRotation::AboutNormal => {
                let slope = |(g, origin): (&[f32; 4], &Origin)| {
                    let turned = origin.turned_by(origin.angle + std::f32::consts::PI);
                    0.5 * (0..4).map(|k| g[k] * turned[k]).sum::<f32>()
                };
                let slopes: Vec<f32> = gradient.rotations.iter().zip(&self.start).map(slope).collect();
                let mut angles: Vec<f32> = self.start.iter().map(|origin| origin.angle).collect();
                self.rotation.step(&mut angles, &slopes, rate);
                for ((rotation, origin), angle) in rotations.iter_mut().zip(&mut self.start).zip(angles) {
                    origin.angle = angle;
                    *rotation = origin.turned_by(angle);
                }
            }
        }
    }

    /// Raises the SH degree; new coefficients are zero.
    pub(super) fn raise_sh_degree(&mut self, degree: usize) {
        let gaussians = &mut self.avatar.gaussians;
        let (from, to) = (gaussians.sh_count(), sh::count(degree));
        if to <= from {
            return;
        }
        gaussians.sh = widened(&gaussians.sh, from, to);
        gaussians.sh_degree = degree;
        self.colour.widen(3 * from, 3 * to);
    }

    /// Replaces the Gaussians: number i of the new avatar continues number `sources[i]`, with its moments, or starts
    /// without any.
    pub(super) fn rearrange(&mut self, avatar: Avatar, origins: Vec<Origin>, sources: &[Option<usize>]) {
        let n = self.len();
        let width = |len: usize| len / n.max(1);
        let widths = [3 * avatar.gaussians.sh_count(), 1, 3];
        let (position, height, rotation) = match &avatar.binding {
            Binding::Face(_) => (3, 1, 4),
            Binding::Static | Binding::Vertex(_) => (3, 0, 4),
        };
        debug_assert_eq!(width(3 * self.avatar.gaussians.sh.len()), widths[0]);
        self.position.rearrange(sources, position);
        self.height.rearrange(sources, height);
        self.rotation.rearrange(sources, rotation);
        self.colour.rearrange(sources, widths[0]);
        self.opacity.rearrange(sources, widths[1]);
        self.scale.rearrange(sources, widths[2]);
        self.start = origins;
        self.avatar = avatar;
    }

    /// The first parameter that is NaN or infinite: its name and Gaussian.
    pub(super) fn broken(&self) -> Option<(&'static str, usize)> {
        broken(&self.avatar.gaussians)
    }
}

impl Origin {
    /// The starting rotation turned about its third axis.
    fn turned_by(&self, angle: f32) -> [f32; 4] {
        let (sin, cos) = portable::sin_cos(0.5 * angle);
        let q = quat(self.rotation) * Quat::from_xyzw(0.0, 0.0, sin, cos);
        [q.w, q.x, q.y, q.z]
    }
}

fn quat([w, x, y, z]: [f32; 4]) -> Quat {
    Quat::from_xyzw(x, y, z, w)
}

fn widened(values: &[[f32; 3]], from: usize, to: usize) -> Vec<[f32; 3]> {
    let mut wider = Vec::with_capacity(values.len() / from * to);
    for row in values.chunks(from) {
        wider.extend_from_slice(row);
        wider.resize(wider.len() + to - from, [0.0; 3]);
    }
    wider
}

fn broken(gaussians: &Gaussians) -> Option<(&'static str, usize)> {
    const PART: usize = 1 << 14;
    let find = |name: &'static str, values: &[f32], width: usize| {
        if values.par_chunks(PART).all(|part| part.iter().all(|v| v.is_finite())) {
            return None;
        }
        values.iter().position(|v| !v.is_finite()).map(|place| (name, place / width))
    };
    find("position", bytemuck::cast_slice(&gaussians.means), 3)
        .or_else(|| find("rotation", gaussians.rotations.as_flattened(), 4))
        .or_else(|| find("scale", bytemuck::cast_slice(&gaussians.log_scales), 3))
        .or_else(|| find("opacity", &gaussians.opacity_logits, 1))
        .or_else(|| find("colour", gaussians.sh.as_flattened(), 3 * gaussians.sh_count()))
}
