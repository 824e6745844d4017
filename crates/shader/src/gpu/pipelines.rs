//! Pipelines of all entry points, dispatches, times.

use super::super::batch::{Batch, Posed};
use super::super::{Colour, Rotation, SKINNING, Shape};
use super::{Avatar, Gpu, GpuError};
use std::time::Instant;
use wgpu::{BindingType, BufferBindingType, BufferUsages};

/// Invocations of a workgroup, as the source has them.
const WORKGROUP: u32 = 64;

/// What is dispatched for each avatar of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// How rotations become one.
    pub rotation: Rotation,
    /// What is written of the shape.
    pub shape: Shape,
    /// What is done about SH afterwards.
    pub colour: Option<Colour>,
}

/// Every entry point, compiled for a device.
pub struct Skinning<'a> {
    gpu: &'a Gpu,
    layouts: [wgpu::BindGroupLayout; 2],
    posing: Vec<[wgpu::ComputePipeline; 2]>,
    colouring: [wgpu::ComputePipeline; 2],
}

impl<'a> Skinning<'a> {
    /// Compiles the source.
    ///
    /// # Errors
    /// The adapter does not take it.
    pub fn new(gpu: &'a Gpu) -> Result<Self, GpuError> {
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let compiled = Self::compile(gpu);
        match pollster::block_on(scope.pop()) {
            None => Ok(compiled),
            Some(problem) => Err(GpuError::refused(&gpu.name, &problem)),
        }
    }

    fn compile(gpu: &'a Gpu) -> Self {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("skinning"),
            source: wgpu::ShaderSource::Wgsl(SKINNING.into()),
        });
        let layouts = [&POSING[..], &COLOURING[..]].map(|kinds| bind_group_layout(gpu, kinds));
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layouts[0]), Some(&layouts[1])],
            immediate_size: 0,
        });
        let pipeline = |entry_point: &str| {
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let posing =
            Rotation::ALL.map(|rotation| Shape::ALL.map(|shape| pipeline(&rotation.entry_point(shape))));
        let colouring = Colour::ALL.map(|colour| pipeline(colour.entry_point()));
        Self { gpu, layouts, posing: posing.into(), colouring }
    }

    /// Hands a batch to the device.
    pub fn upload(&self, batch: &Batch) -> Avatar {
        Avatar::new(self.gpu, &self.layouts, batch)
    }

    /// All that a choice of rotation writes of a batch: both shapes, colours, turned SH.
    ///
    /// # Errors
    /// The device was lost.
    pub fn pose(&self, batch: &Batch, rotation: Rotation) -> Result<Posed, GpuError> {
        let avatar = self.upload(batch);
        for (shape, colour) in Shape::ALL.into_iter().zip(Colour::ALL) {
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            let frame = Frame { rotation, shape, colour: Some(colour) };
            self.record(&mut encoder.begin_compute_pass(&Default::default()), &[&avatar], frame);
            self.gpu.queue.submit([encoder.finish()]);
        }
        avatar.posed(self.gpu)
    }

    /// Milliseconds of each of a number of frames in which all avatars are posed: by the device's clock, or, where it has
    /// none, the wall clock's time of all of them divided among them.
    ///
    /// # Errors
    /// The device was lost.
    pub fn times(&self, avatars: &[&Avatar], frame: Frame, frames: u32) -> Result<Vec<f64>, GpuError> {
        match self.gpu.tick {
            Some(tick) => self.device_times(avatars, frame, frames, tick),
            None => Ok(vec![self.wall_time(avatars, frame, frames)?; frames as usize]),
        }
    }

    /// Milliseconds of one frame by the wall clock, over a number of frames handed in one by one without waiting in between.
    ///
    /// # Errors
    /// The device was lost.
    pub fn wall_time(&self, avatars: &[&Avatar], frame: Frame, frames: u32) -> Result<f64, GpuError> {
        let start = Instant::now();
        for _ in 0..frames {
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            self.record(&mut encoder.begin_compute_pass(&Default::default()), avatars, frame);
            self.gpu.queue.submit([encoder.finish()]);
        }
        self.gpu.wait()?;
        Ok(start.elapsed().as_secs_f64() * 1e3 / f64::from(frames))
    }

    fn device_times(
        &self,
        avatars: &[&Avatar],
        frame: Frame,
        frames: u32,
        tick: f64,
    ) -> Result<Vec<f64>, GpuError> {
        let device = &self.gpu.device;
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count: 2 * frames,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 16 * u64::from(frames),
            usage: BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        for k in 0..frames {
            let mut encoder = device.create_command_encoder(&Default::default());
            let descriptor = wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                    query_set: &queries,
                    beginning_of_pass_write_index: Some(2 * k),
                    end_of_pass_write_index: Some(2 * k + 1),
                }),
            };
            self.record(&mut encoder.begin_compute_pass(&descriptor), avatars, frame);
            self.gpu.queue.submit([encoder.finish()]);
        }
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.resolve_query_set(&queries, 0..2 * frames, &resolved, 0);
        self.gpu.queue.submit([encoder.finish()]);
        let ticks: Vec<[u64; 2]> = bytemuck::pod_collect_to_vec(&self.gpu.read(&resolved)?);
        Ok(ticks.iter().map(|[start, end]| end.wrapping_sub(*start) as f64 * tick / 1e6).collect())
    }

    /// Posing of all avatars, then their colours, so that the device can overlap avatars.
    fn record(&self, pass: &mut wgpu::ComputePass<'_>, avatars: &[&Avatar], frame: Frame) {
        let position = Rotation::ALL.iter().position(|&r| r == frame.rotation).unwrap_or_default();
        let posing = &self.posing[position][usize::from(frame.shape == Shape::Quaternion)];
        let colouring = frame.colour.map(|c| &self.colouring[usize::from(c == Colour::TurnSh)]);
        for pipeline in [Some(posing), colouring].into_iter().flatten() {
            pass.set_pipeline(pipeline);
            for avatar in avatars {
                pass.set_bind_group(0, &avatar.groups[0], &[]);
                pass.set_bind_group(1, &avatar.groups[1], &[]);
                pass.dispatch_workgroups(avatar.count.div_ceil(WORKGROUP), 1, 1);
            }
        }
    }
}

const READ: BufferBindingType = BufferBindingType::Storage { read_only: true };
const WRITE: BufferBindingType = BufferBindingType::Storage { read_only: false };

/// Group 0.
const POSING: [BufferBindingType; 10] =
    [BufferBindingType::Uniform, READ, READ, READ, READ, WRITE, WRITE, WRITE, WRITE, WRITE];

/// Group 1.
const COLOURING: [BufferBindingType; 3] = [READ, WRITE, WRITE];

fn bind_group_layout(gpu: &Gpu, kinds: &[BufferBindingType]) -> wgpu::BindGroupLayout {
    let entry = |(binding, &ty): (usize, &BufferBindingType)| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let entries: Vec<_> = kinds.iter().enumerate().map(entry).collect();
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}
