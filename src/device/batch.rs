//! Dispatches recorded one after another, run as one submission, and read back.

use super::Kernel;
use super::gpu::Gpu;
use super::memory::{Buffer, DOWNLOAD, UNIFORM};
use crate::{Error, Result};
use bytemuck::Pod;
use std::time::Duration;

/// A submission that takes longer has hung.
const PATIENCE: Duration = Duration::from_secs(120);

/// Dispatches see the writes of those before them.
pub struct Batch<'a> {
    gpu: &'a Gpu,
    encoder: wgpu::CommandEncoder,
    /// Kept out of the pool until the submission.
    held: Vec<Buffer>,
}

impl<'a> Batch<'a> {
    pub(super) fn new(gpu: &'a Gpu) -> Self {
        let encoder = gpu.device.create_command_encoder(&Default::default());
        Self { gpu, encoder, held: Vec::new() }
    }

    /// Runs `groups` workgroups of a kernel on buffers in the order of its declaration.
    pub fn dispatch<P: Pod>(&mut self, kernel: &Kernel, params: &P, buffers: &[&Buffer], groups: usize) -> Result<()> {
        assert_eq!(size_of::<P>(), kernel.uniform.size, "{}: another kernel's uniform", kernel.name);
        assert_eq!(buffers.len(), kernel.bindings.len(), "{}: buffers and bindings", kernel.name);
        if groups == 0 {
            return Ok(());
        }
        for buffer in buffers {
            self.gpu.check_binding(kernel, buffer)?;
        }
        let pipeline = self.gpu.pipeline(kernel)?;
        let uniform = self.gpu.memory.buffer(UNIFORM, size_of::<P>() as u64);
        self.gpu.memory.write(&uniform, 0, std::slice::from_ref(params));
        self.held.push(uniform.clone());
        self.held.extend(buffers.iter().map(|&buffer| buffer.clone()));
        let entries: Vec<_> = std::iter::once(&uniform)
            .chain(buffers.iter().copied())
            .enumerate()
            .map(|(i, buffer)| wgpu::BindGroupEntry { binding: i as u32, resource: buffer.binding() })
            .collect();
        let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.name),
            layout: &pipeline.layout,
            entries: &entries,
        });
        let [x, y, z] = self.gpu.grid(groups as u32);
        let mut pass = self.encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline.compute);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(x, y, z);
        Ok(())
    }

    /// Submits, waits, and hands the content of `buffer` to `take`.
    pub fn read<T: Pod, R>(mut self, buffer: &Buffer, take: impl FnOnce(&[T]) -> R) -> Result<R> {
        let download = self.gpu.memory.buffer(DOWNLOAD, buffer.bytes());
        self.encoder.copy_buffer_to_buffer(buffer.raw(), 0, download.raw(), 0, buffer.bytes());
        self.gpu.queue.submit([self.encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        download.raw().map_async(wgpu::MapMode::Read, 0..buffer.bytes(), move |result| {
            // The receiver is gone when waiting failed; nobody is interested then.
            let _ = sender.send(result);
        });
        let poll = wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) };
        let waited = self.gpu.device.poll(poll);
        self.gpu.check()?;
        let failed = |what: String| {
            Error::device(format!("GPU \"{}\" did not finish: {what}", self.gpu.name()), "use --device cpu")
        };
        waited.map_err(|error| failed(error.to_string()))?;
        let mapped = receiver.recv().map_err(|error| failed(error.to_string()))?;
        mapped.map_err(|error| failed(error.to_string()))?;
        let result = {
            let view = download.raw().get_mapped_range(0..buffer.bytes()).map_err(|error| failed(error.to_string()))?;
            take(bytemuck::cast_slice(&view))
        };
        download.raw().unmap();
        Ok(result)
    }
}
