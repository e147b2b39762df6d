//! The GPU engine: one wgpu device, its pipelines by kernel, its memory, and what went wrong with it.
//!
//! Kernels record dispatches in a `Batch` (see `batch`), which runs as one submission. wgpu reports faults through
//! callbacks; they are kept here and come out as `Error::Device` at the next check, never as a panic.

use super::batch::Batch;
use super::memory::{Buffer, Memory, STORAGE};
use super::{Access, Array, Kernel};
use crate::{Error, Result};
use bytemuck::Pod;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Larger inputs are worked on in pages of this size at most, which keeps each dispatch far below the time after which
/// drivers reset a device.
const PAGE_BYTES: u64 = 64 << 20;

pub struct Gpu {
    name: String,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) memory: Memory,
    limits: wgpu::Limits,
    page_bytes: u64,
    pipelines: Mutex<HashMap<&'static str, Arc<Pipeline>>>,
    faults: Arc<Mutex<Faults>>,
}

/// A compiled kernel.
pub(super) struct Pipeline {
    pub compute: wgpu::ComputePipeline,
    pub layout: wgpu::BindGroupLayout,
}

#[derive(Default)]
struct Faults {
    /// The device is gone for good.
    lost: Option<String>,
    /// The first error since the last check.
    error: Option<String>,
}

impl Gpu {
    /// Opens an adapter with all the limits that it has.
    pub fn open(adapter: &wgpu::Adapter) -> Result<Self> {
        let info = adapter.get_info();
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("chiaro"),
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).map_err(|error| {
            Error::device(format!("GPU \"{}\" cannot be opened: {error}", info.name), "use --device cpu")
        })?;
        let faults = Arc::new(Mutex::new(Faults::default()));
        let sink = faults.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            let mut faults = sink.lock().expect("no panic while noting a fault");
            faults.error.get_or_insert_with(|| error.to_string());
        }));
        let sink = faults.clone();
        device.set_device_lost_callback(move |reason, message| {
            let mut faults = sink.lock().expect("no panic while noting a fault");
            faults.lost.get_or_insert_with(|| format!("the device was lost ({reason:?}) {message}"));
        });
        Ok(Self {
            name: info.name,
            memory: Memory::new(&device, &queue),
            page_bytes: PAGE_BYTES.min(limits.max_storage_buffer_binding_size),
            limits,
            device,
            queue,
            pipelines: Mutex::default(),
            faults,
        })
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Makes pages smaller, so that tests page small inputs.
    pub fn set_page_bytes(&mut self, bytes: u64) {
        self.page_bytes = bytes.min(self.limits.max_storage_buffer_binding_size);
    }

    /// How many elements of that many bytes a page holds; at least 1.
    pub fn page(&self, bytes: usize) -> usize {
        (self.page_bytes as usize / bytes.max(1)).max(1)
    }

    /// A storage buffer of undefined content for `count` elements.
    pub fn storage<T: Pod>(&self, count: usize) -> Buffer {
        self.memory.buffer(STORAGE, (count.max(1) * size_of::<T>()) as u64)
    }

    /// A storage buffer with a copy of `data`.
    pub fn upload<T: Pod>(&self, data: &[T]) -> Buffer {
        self.memory.upload(data)
    }

    /// A storage buffer with parts of equal length one after another: element range `range` of each of the vectors of
    /// `length` elements in `data`.
    pub fn upload_columns<T: Pod>(&self, data: &[T], length: usize, range: Range<usize>) -> Buffer {
        self.upload_parts(data.chunks_exact(length.max(1)).map(|column| &column[range.clone()]))
    }

    /// A storage buffer with the parts one after another.
    pub fn upload_parts<'a, T: Pod>(&self, parts: impl Iterator<Item = &'a [T]> + Clone) -> Buffer {
        let buffer = self.storage::<T>(parts.clone().map(<[T]>::len).sum());
        let mut offset = 0;
        for part in parts {
            self.memory.write(&buffer, offset, part);
            offset += size_of_val(part) as u64;
        }
        buffer
    }

    /// Overwrites elements from `first` on, before the next batch runs.
    pub fn write<T: Pod>(&self, buffer: &Buffer, first: usize, data: &[T]) {
        self.memory.write(buffer, (first * size_of::<T>()) as u64, data);
    }

    /// Part of an array; uploaded once for as long as the memory budget allows.
    pub fn array<T: Pod>(&self, array: &Array<T>, range: Range<usize>) -> Buffer {
        self.memory.array(array, range)
    }

    /// All of an array.
    pub fn whole<T: Pod>(&self, array: &Array<T>) -> Buffer {
        self.memory.array(array, 0..array.len())
    }

    pub fn batch(&self) -> Batch<'_> {
        Batch::new(self)
    }

    /// The workgroups of a dispatch: a row, folded when it is longer than a dimension may be (`shared/grid.wgsl`).
    pub(super) fn grid(&self, groups: u32) -> [u32; 3] {
        let x = groups.min(self.limits.max_compute_workgroups_per_dimension);
        [x, groups.div_ceil(x.max(1)), 1]
    }

    /// `Error::Device` when a buffer is larger than a shader may see.
    pub(super) fn check_binding(&self, kernel: &Kernel, buffer: &Buffer) -> Result<()> {
        let limit = self.limits.max_storage_buffer_binding_size;
        if buffer.bytes() <= limit {
            return Ok(());
        }
        Err(Error::device(
            format!("{}: {} bytes in one piece; GPU \"{}\" allows {limit}", kernel.name, buffer.bytes(), self.name),
            "use --device cpu, or fewer gather samples",
        ))
    }

    /// `Error::Device` when something went wrong since the last check.
    pub(super) fn check(&self) -> Result<()> {
        let mut faults = self.faults.lock().expect("no panic while noting a fault");
        let error = faults.error.take();
        match faults.lost.clone().or(error) {
            Some(fault) => Err(Error::device(format!("GPU \"{}\" failed: {fault}", self.name), "use --device cpu")),
            None => Ok(()),
        }
    }

    /// Compiles a kernel, once.
    pub(super) fn pipeline(&self, kernel: &Kernel) -> Result<Arc<Pipeline>> {
        let mut pipelines = self.pipelines.lock().expect("no panic while compiling");
        if let Some(pipeline) = pipelines.get(kernel.name) {
            return Ok(pipeline.clone());
        }
        let pipeline = Arc::new(self.compile(kernel));
        self.check()?;
        pipelines.insert(kernel.name, pipeline.clone());
        Ok(pipeline)
    }

    fn compile(&self, kernel: &Kernel) -> Pipeline {
        let entry = |binding: usize, ty: wgpu::BufferBindingType, size: usize| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty,
                has_dynamic_offset: false,
                min_binding_size: wgpu::BufferSize::new(size as u64),
            },
            count: None,
        };
        let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform, kernel.uniform.size)];
        for (i, binding) in kernel.bindings.iter().enumerate() {
            let read_only = binding.access == Access::Read;
            entries.push(entry(i + 1, wgpu::BufferBindingType::Storage { read_only }, binding.stride));
        }
        let label = Some(kernel.name);
        let layout =
            self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(kernel.wgsl().into()),
        });
        let compute = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(kernel.name),
            compilation_options: Default::default(),
            cache: None,
        });
        Pipeline { compute, layout }
    }
}
