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

    /// Submits, waits, and gives the content of the buffers.
    pub fn read<const N: usize>(mut self, buffers: [&Buffer; N]) -> Result<[Download; N]> {
        let downloads = buffers.map(|buffer| self.gpu.memory.buffer(DOWNLOAD, buffer.bytes()));
        for (buffer, download) in buffers.iter().zip(&downloads) {
            self.encoder.copy_buffer_to_buffer(buffer.raw(), 0, download.raw(), 0, buffer.bytes());
        }
        self.gpu.queue.submit([self.encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        for download in &downloads {
            let sender = sender.clone();
            download.raw().map_async(wgpu::MapMode::Read, 0..download.bytes(), move |result| {
                // The receiver is gone when waiting failed; nobody is interested then.
                let _ = sender.send(result);
            });
        }
        let waited = self.gpu.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) });
        self.gpu.check()?;
        let failed = |what: &dyn std::fmt::Display| {
            Error::device(format!("GPU \"{}\" did not finish: {what}", self.gpu.name()), "use --device cpu")
        };
        waited.map_err(|error| failed(&error))?;
        for _ in &downloads {
            receiver.recv().map_err(|error| failed(&error))?.map_err(|error| failed(&error))?;
        }
        let views = downloads.each_ref().map(|download| download.raw().get_mapped_range(0..download.bytes()));
        let mut buffers = downloads.into_iter();
        let mut results = Vec::with_capacity(N);
        for view in views {
            let buffer = buffers.next().expect("a view of each");
            results.push(Download { view: Some(view.map_err(|error| failed(&error))?), buffer });
        }
        Ok(results.try_into().unwrap_or_else(|_| unreachable!("one result a buffer")))
    }
}

/// What a buffer held when its batch was done.
pub struct Download {
    /// Taken before the buffer is unmapped.
    view: Option<wgpu::BufferView>,
    buffer: Buffer,
}

impl Download {
    pub fn get<T: Pod>(&self) -> &[T] {
        self.view.as_ref().map_or(&[], |view| bytemuck::cast_slice(view))
    }
}

impl Drop for Download {
    fn drop(&mut self) {
        self.view = None;
        self.buffer.raw().unmap();
    }
}
