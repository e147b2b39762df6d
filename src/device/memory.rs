//! GPU memory: storage buffers that go back to a pool when they are dropped, and arrays that stay uploaded.
//!
//! A buffer may be handed out again while commands that used it still run: the queue keeps the order. Within a batch
//! that is not yet submitted it may not, so a `Batch` holds on to the buffers it uses.

use super::Array;
use bytemuck::Pod;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Bytes of free buffers that the pool keeps.
const POOL_BYTES: u64 = 512 << 20;
/// Bytes of arrays that stay uploaded when nobody holds them.
const CACHE_BYTES: u64 = 1 << 30;

/// A buffer on the GPU; clones share it.
#[derive(Clone)]
pub struct Buffer(Arc<Pooled>);

struct Pooled {
    raw: wgpu::Buffer,
    /// Bytes in use; the buffer itself may be larger.
    bytes: u64,
    pool: Arc<Mutex<Pool>>,
}

impl Buffer {
    pub fn bytes(&self) -> u64 {
        self.0.bytes
    }

    pub(super) fn raw(&self) -> &wgpu::Buffer {
        &self.0.raw
    }

    pub(super) fn binding(&self) -> wgpu::BindingResource<'_> {
        let size = wgpu::BufferSize::new(self.0.bytes);
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: &self.0.raw, offset: 0, size })
    }
}

impl Drop for Pooled {
    fn drop(&mut self) {
        if let Ok(mut pool) = self.pool.lock() {
            pool.keep(&self.raw);
        }
    }
}

/// Free buffers by usage and size.
#[derive(Default)]
struct Pool {
    free: HashMap<(wgpu::BufferUsages, u64), Vec<wgpu::Buffer>>,
    bytes: u64,
}

impl Pool {
    fn keep(&mut self, buffer: &wgpu::Buffer) {
        if self.bytes + buffer.size() <= POOL_BYTES {
            self.bytes += buffer.size();
            self.free.entry((buffer.usage(), buffer.size())).or_default().push(buffer.clone());
        }
    }

    fn take(&mut self, usage: wgpu::BufferUsages, size: u64) -> Option<wgpu::Buffer> {
        let buffer = self.free.get_mut(&(usage, size))?.pop()?;
        self.bytes -= size;
        Some(buffer)
    }
}

/// Part of an array: its identity and element range.
type Part = (u64, usize, usize);

/// Uploaded arrays, least recently used first to go.
#[derive(Default)]
struct Uploads {
    buffers: HashMap<Part, (Buffer, u64)>,
    bytes: u64,
    clock: u64,
}

pub(super) struct Memory {
    device: wgpu::Device,
    queue: wgpu::Queue,
    max_buffer: u64,
    pool: Arc<Mutex<Pool>>,
    uploads: Mutex<Uploads>,
}

pub(super) const STORAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC).union(wgpu::BufferUsages::COPY_DST);
pub(super) const UNIFORM: wgpu::BufferUsages = wgpu::BufferUsages::UNIFORM.union(wgpu::BufferUsages::COPY_DST);
pub(super) const DOWNLOAD: wgpu::BufferUsages = wgpu::BufferUsages::MAP_READ.union(wgpu::BufferUsages::COPY_DST);

impl Memory {
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let max_buffer = device.limits().max_buffer_size;
        let (device, queue) = (device.clone(), queue.clone());
        Self { device, queue, max_buffer, pool: Arc::default(), uploads: Mutex::default() }
    }

    /// A buffer of undefined content.
    pub fn buffer(&self, usage: wgpu::BufferUsages, bytes: u64) -> Buffer {
        // Few sizes, so that buffers are found again: powers of two, and whole mebibytes above one.
        let size = if bytes > 1 << 20 { bytes.next_multiple_of(1 << 20) } else { bytes.max(256).next_power_of_two() };
        let size = size.min(self.max_buffer).max(bytes);
        let pooled = self.pool.lock().expect("no panic while pooling").take(usage, size);
        let raw = pooled.unwrap_or_else(|| {
            self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        });
        Buffer(Arc::new(Pooled { raw, bytes, pool: self.pool.clone() }))
    }

    /// Fills a buffer from byte `offset` on, before the next batch runs.
    pub fn write<T: Pod>(&self, buffer: &Buffer, offset: u64, data: &[T]) {
        self.queue.write_buffer(buffer.raw(), offset, bytemuck::cast_slice(data));
    }

    /// A storage buffer that holds `data`; an empty slice gets room for one element, because no binding may be empty.
    pub fn upload<T: Pod>(&self, data: &[T]) -> Buffer {
        let buffer = self.buffer(STORAGE, size_of_val(data).max(size_of::<T>()) as u64);
        self.write(&buffer, 0, data);
        buffer
    }

    /// The elements `range` of an array, uploaded now or before.
    pub fn array<T: Pod>(&self, array: &Array<T>, range: Range<usize>) -> Buffer {
        let part = (array.id(), range.start, range.end);
        let mut uploads = self.uploads.lock().expect("no panic while uploading");
        uploads.clock += 1;
        let now = uploads.clock;
        if let Some((buffer, used)) = uploads.buffers.get_mut(&part) {
            *used = now;
            return buffer.clone();
        }
        let buffer = self.upload(&array[range]);
        while uploads.bytes + buffer.bytes() > CACHE_BYTES && !uploads.buffers.is_empty() {
            let oldest = uploads.buffers.iter().min_by_key(|(_, (_, used))| *used).map(|(part, _)| *part);
            let removed = oldest.and_then(|part| uploads.buffers.remove(&part));
            uploads.bytes -= removed.map_or(0, |(buffer, _)| buffer.bytes());
        }
        uploads.bytes += buffer.bytes();
        uploads.buffers.insert(part, (buffer.clone(), now));
        buffer
    }
}
