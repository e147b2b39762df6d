//! What an environment would do to samples if nothing cast a shadow (thesis 6.3: all of the integral but visibility).

use crate::device::Array;
use crate::scene::Environment;
use crate::transport::Samples;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct DirectTransport {
    pub environment: Arc<Environment>,
    pub samples: Arc<Samples>,
    /// Diffuse reflectance of the samples, RGB and a 1 where there is a surface.
    pub reflectance: Array<[f32; 4]>,
}

impl DirectTransport {
    pub fn bytes(&self) -> u64 {
        self.environment.bytes() + 16 * self.reflectance.len() as u64
    }
}
