//! What the rays of rows met at one moment, kept for the next: where things move, most rays meet the same again.

use crate::device::Array;
use crate::memo::{Key, Memo};
use crate::scene::{Change, Geometry, SurfacePoint};
use std::collections::HashMap;
use std::sync::Arc;

/// Rows, and the triangles that their rays met.
pub struct Met {
    /// Where all triangles were.
    corners: Array<[[f32; 3]; 3]>,
    /// Where rays of a row started, and its place in `triangles`, by sample.
    rows: HashMap<u32, (SurfacePoint, usize)>,
    /// Rows x rays; `NONE` for a ray that met nothing.
    triangles: Vec<u32>,
    rays: usize,
}

impl Met {
    fn bytes(&self) -> u64 {
        64 * self.rows.len() as u64 + 4 * self.triangles.len() as u64 + 36 * self.corners.len() as u64
    }

    /// What the rays of that row met, if it started where it starts now.
    fn row(&self, sample: u32, point: &SurfacePoint) -> Option<&[u32]> {
        let (then, first) = self.rows.get(&sample)?;
        (bytemuck::bytes_of(then) == bytemuck::bytes_of(point)).then(|| &self.triangles[*first..][..self.rays])
    }
}

/// Remembers what rays meet in surfaces that move, from the frame before to the frame after.
pub struct Remembered<'a> {
    memo: &'a dyn Memo,
    key: Key,
    before: Option<(Arc<Met>, Change)>,
    now: Met,
    /// Bytes that may be kept; 0 where it is not worth it.
    room: u64,
}

impl<'a> Remembered<'a> {
    /// `what`: all that tells these rays from others, besides where surfaces are and where rows start.
    pub fn new(memo: &'a dyn Memo, geometry: &Geometry, what: &[u8], rays: usize) -> Self {
        let moves = !geometry.poses.is_empty();
        let count = rays.to_le_bytes();
        let mut parts: Vec<&[u8]> = vec![b"met", what, &count];
        parts.extend(geometry.over_time().iter().map(|pose| &pose.fingerprint[..]));
        let key = Key::of(&parts);
        let before = || {
            let met = memo.get(key)?.downcast::<Met>().ok()?;
            let change = Change::since(&met.corners, geometry)?;
            Some((met, change))
        };
        Self {
            memo,
            key,
            before: if moves { before() } else { None },
            now: Met { corners: geometry.corners.clone(), rows: HashMap::new(), triangles: Vec::new(), rays },
            room: if moves { memo.room() } else { 0 },
        }
    }

    /// What moved since, and what the rays of these samples met.
    pub fn before(&self, samples: &[usize], points: &[SurfacePoint]) -> Option<(&Change, Vec<Option<&[u32]>>)> {
        let (met, change) = self.before.as_ref()?;
        Some((change, samples.iter().zip(points).map(|(sample, point)| met.row(*sample as u32, point)).collect()))
    }

    /// Takes what the rays of these samples met, as far as there is room.
    pub fn take(&mut self, samples: &[usize], points: &[SurfacePoint], met: &[u32]) {
        let rays = self.now.rays;
        for ((sample, point), met) in samples.iter().zip(points).zip(met.chunks_exact(rays)) {
            if self.now.bytes() + 4 * rays as u64 + 64 > self.room {
                return;
            }
            self.now.rows.insert(*sample as u32, (*point, self.now.triangles.len()));
            self.now.triangles.extend_from_slice(met);
        }
    }

    pub fn keep(self) {
        if !self.now.rows.is_empty() {
            let bytes = self.now.bytes();
            self.memo.put(self.key, Arc::new(self.now), bytes);
        }
    }
}
