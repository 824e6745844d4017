//! A batch on the device.

use super::super::batch::{Batch, COEFFICIENTS, Posed};
use super::super::layout::{self, Params};
use super::{Gpu, GpuError};
use bytemuck::Pod;
use wgpu::BufferUsages;

/// Buffers of a batch and what binds them.
pub struct Avatar {
    pub(super) groups: [wgpu::BindGroup; 2],
    pub(super) count: u32,
    means: wgpu::Buffer,
    covariances: wgpu::Buffer,
    quaternions: wgpu::Buffer,
    relatives: wgpu::Buffer,
    views: wgpu::Buffer,
    turned_sh: wgpu::Buffer,
    colours: wgpu::Buffer,
}

impl Avatar {
    /// Hands a batch to the device.
    pub(super) fn new(gpu: &Gpu, layouts: &[wgpu::BindGroupLayout; 2], batch: &Batch) -> Self {
        let input = |bytes: &[u8], usage| {
            let buffer = buffer(gpu, bytes.len() as u64, usage | BufferUsages::COPY_DST);
            gpu.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let storage = |bytes: &[u8]| input(bytes, BufferUsages::STORAGE);
        let output = |numbers: usize| {
            let bytes = 4 * numbers * batch.len();
            buffer(gpu, bytes as u64, BufferUsages::STORAGE | BufferUsages::COPY_SRC)
        };
        let params = input(bytemuck::cast_slice(&batch.params().words()), BufferUsages::UNIFORM);
        let joints = storage(bytemuck::cast_slice(&batch.joint_words()));
        let gaussians = storage(bytemuck::cast_slice(&batch.gaussian_words()));
        let indices = storage(bytemuck::cast_slice(&batch.indices));
        let weights = storage(bytemuck::cast_slice(&batch.weights));
        let sh = storage(bytemuck::cast_slice(&batch.sh_words()));
        let [means, quaternions, relatives, views, colours] = std::array::from_fn(|_| output(4));
        let (covariances, turned_sh) = (output(6), output(3 * COEFFICIENTS));
        let posing = [
            &params,
            &joints,
            &gaussians,
            &indices,
            &weights,
            &means,
            &covariances,
            &quaternions,
            &relatives,
            &views,
        ];
        let groups =
            [group(gpu, &layouts[0], &posing), group(gpu, &layouts[1], &[&sh, &turned_sh, &colours])];
        Self {
            groups,
            count: batch.len() as u32,
            means,
            covariances,
            quaternions,
            relatives,
            views,
            turned_sh,
            colours,
        }
    }

    /// Reads back all that was written.
    pub(super) fn posed(&self, gpu: &Gpu) -> Result<Posed, GpuError> {
        let three = |buffer| {
            Ok(numbers::<[f32; 4]>(gpu, buffer)?.into_iter().map(|[x, y, z, _]| [x, y, z]).collect())
        };
        let rotations = |buffer| Ok(numbers(gpu, buffer)?.into_iter().map(layout::quaternion).collect());
        let sh: Vec<[f32; 3]> = numbers(gpu, &self.turned_sh)?;
        let count = self.count as usize;
        let own = |i: usize| std::array::from_fn(|k| sh[k * count + i]);
        Ok(Posed {
            means: three(&self.means)?,
            covariances: numbers(gpu, &self.covariances)?,
            quaternions: rotations(&self.quaternions)?,
            relatives: rotations(&self.relatives)?,
            views: three(&self.views)?,
            turned_sh: (0..count).map(own).collect(),
            colours: three(&self.colours)?,
        })
    }
}

/// The block of a dispatch never changes its size.
const _: () = assert!(Params::SIZE == 4 * 12);

fn buffer(gpu: &Gpu, size: u64, usage: BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}

fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries: Vec<_> = buffers
        .iter()
        .zip(0..)
        .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn numbers<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<T>, GpuError> {
    Ok(bytemuck::pod_collect_to_vec(&gpu.read(buffer)?))
}
