//! Which adapter computes.

use std::fmt;
use wgpu::{Backends, DeviceType};

/// Why nothing was computed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GpuError {
    /// There is no Vulkan adapter.
    NoAdapter,
    /// No adapter has this in its name; the names there are.
    NotFound(String, Vec<String>),
    /// The adapter (by name) would not do, and why.
    Refused(String, String),
    /// The device failed while it computed.
    Lost(String),
}

impl fmt::Display for GpuError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAdapter => write!(
                f,
                "no adapter: expected a Vulkan driver and its loader (libvulkan.so.1; a software one: Debian's \
                 mesa-vulkan-drivers)"
            ),
            Self::NotFound(name, there) => {
                write!(f, "adapter `{name}`: not found; expected part of one of: {}", there.join(", "))
            }
            Self::Refused(name, why) => write!(f, "adapter `{name}`: {why}"),
            Self::Lost(why) => write!(f, "the device failed: {why}"),
        }
    }
}

impl std::error::Error for GpuError {}

impl GpuError {
    pub(super) fn refused(name: &str, why: &dyn fmt::Display) -> Self {
        Self::Refused(name.to_owned(), one_line(why))
    }
}

/// An open device.
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    /// Name and driver of the adapter.
    pub name: String,
    /// It computes on the CPU.
    pub is_software: bool,
    /// Nanoseconds per tick, where the device tells time.
    pub(super) tick: Option<f64>,
}

fn adapters() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    let instance = wgpu::Instance::new(descriptor);
    let mut found = pollster::block_on(instance.enumerate_adapters(Backends::VULKAN));
    found.sort_by_key(|adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    });
    found
}

fn name_of(adapter: &wgpu::Adapter) -> String {
    let info = adapter.get_info();
    let driver = format!("{} {}", info.driver, info.driver_info);
    format!("{} ({})", info.name, driver.trim())
}

/// Names of the adapters, the one that is taken unasked first.
pub fn list() -> Vec<String> {
    adapters().iter().map(name_of).collect()
}

impl Gpu {
    /// Opens the best adapter, or the first whose name holds `name` (in any case).
    ///
    /// # Errors
    /// No adapter, none of that name, or one without what the shader needs.
    pub fn open(name: Option<&str>) -> Result<Self, GpuError> {
        let adapters = adapters();
        if adapters.is_empty() {
            return Err(GpuError::NoAdapter);
        }
        let wanted = name.unwrap_or_default().to_lowercase();
        let adapter = adapters
            .iter()
            .find(|adapter| name_of(adapter).to_lowercase().contains(&wanted))
            .ok_or_else(|| GpuError::NotFound(wanted.clone(), adapters.iter().map(name_of).collect()))?;
        Self::of_adapter(adapter)
    }

    fn of_adapter(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let name = name_of(adapter);
        let times = adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < 12 {
            let there = limits.max_storage_buffers_per_shader_stage;
            return Err(GpuError::Refused(
                name,
                format!("{there} storage buffers per stage; expected 12 or more"),
            ));
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: None,
            required_features: if times { wgpu::Features::TIMESTAMP_QUERY } else { wgpu::Features::empty() },
            required_limits: limits,
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|e| GpuError::refused(&name, &e))?;
        let tick = times.then(|| f64::from(queue.get_timestamp_period()));
        let is_software = adapter.get_info().device_type == DeviceType::Cpu;
        Ok(Self { device, queue, name, is_software, tick })
    }

    /// The device tells time.
    pub fn has_timestamps(&self) -> bool {
        self.tick.is_some()
    }

    /// Waits for everything that was handed in.
    pub(super) fn wait(&self) -> Result<(), GpuError> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        waited.map(drop).map_err(|e| GpuError::Lost(one_line(&e)))
    }

    /// The bytes of a buffer that can be copied from.
    pub(super) fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let size = buffer.size();
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
        self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        self.wait()?;
        let mapped = staging.get_mapped_range(..).map_err(|e| GpuError::Lost(one_line(&e)))?;
        Ok(mapped.to_vec())
    }
}

/// An error's text without its line breaks.
fn one_line(error: &dyn fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
