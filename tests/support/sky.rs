//! Environments and visibility for tests, without a graph.

use chiaro::Result;
use chiaro::device::Device;
use chiaro::kernels::visibility_masks;
use chiaro::memo::{Key, Memo};
use chiaro::progress::Progress;
use chiaro::scene::cube::{self, FACES};
use chiaro::scene::{Environment, Geometry, Occluders, Scene, SurfacePoint};
use chiaro::transport::Samples;
use chiaro::transport::samples::reflectance;
use chiaro::transport::shadow::bake::{self, Settings};
use chiaro::transport::shadow::haar::Truncation;
use chiaro::transport::shadow::integrate::Stage;
use chiaro::transport::shadow::visibility::Scratch;
use chiaro::transport::shadow::{Basis, DirectTransport, Group, Visibility};
use rayon::prelude::*;
use std::any::Any;
use std::cell::Cell;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Remembers everything.
#[derive(Default)]
pub struct Memory(Mutex<HashMap<Key, Arc<dyn Any + Send + Sync>>>);

impl Memo for Memory {
    fn get(&self, key: Key) -> Option<Arc<dyn Any + Send + Sync>> {
        self.0.lock().unwrap().get(&key).cloned()
    }
    fn put(&self, key: Key, value: Arc<dyn Any + Send + Sync>, _: u64) {
        self.0.lock().unwrap().insert(key, value);
    }
    fn room(&self) -> u64 {
        u64::MAX
    }
}

pub struct View {
    pub geometry: Arc<Geometry>,
    pub samples: Arc<Samples>,
    pub transport: DirectTransport,
    pub memory: Memory,
    pub truncation: Truncation,
}

impl View {
    pub fn new(scene: &Scene, size: (u32, u32), per_pixel: u32, environment: Environment) -> Self {
        let geometry = scene.geometry.clone();
        let camera = scene.cameras.first().expect("the scene has a camera");
        let samples = Arc::new(Samples::view(&Device::Cpu, &geometry, camera, size, per_pixel).unwrap());
        let transport = DirectTransport {
            environment: Arc::new(environment),
            samples: samples.clone(),
            reflectance: reflectance(&geometry, &scene.materials, &samples.points, &samples.barycentrics).into(),
            emission: Default::default(),
        };
        let truncation = Truncation { coefficients: 200, tolerance: None };
        Self { geometry, samples, transport, memory: Memory::default(), truncation }
    }

    /// As the node `visibility` does, for all faces with light.
    pub fn bake(&self, basis: Basis, groups: &[(&str, &[&str])]) -> Visibility {
        self.try_bake(basis, groups).unwrap()
    }

    pub fn try_bake(&self, basis: Basis, groups: &[(&str, &[&str])]) -> Result<Visibility> {
        let size = self.transport.environment.size;
        let patterns: Vec<(&str, Vec<String>)> =
            groups.iter().map(|(name, list)| (*name, list.iter().map(|p| p.to_string()).collect())).collect();
        let wanted = patterns.iter().map(|(name, list)| (*name, list.as_slice()));
        let groups = bake::groups(wanted, &self.geometry)?;
        let groups = groups.into_iter().map(|(name, objects)| {
            let occluders = Occluders::new(&self.geometry, |object| objects.contains(&object));
            let mut faces = [const { None }; FACES];
            for (face, rows) in faces.iter_mut().enumerate() {
                let Some(wanted) = bake::wanted(&self.transport.environment, face) else { continue };
                let settings = Settings { face, size, basis, truncation: self.truncation };
                let stage = Progress::silent().stage("", 0);
                let draw = |points: &[_], face, size, wanted: Option<&[u32]>| {
                    visibility_masks(&Device::Cpu, &occluders, points, face, size, wanted)
                };
                *rows = Some(Arc::new(
                    bake::face(&draw, &self.samples.points, &settings, Some(&wanted), None, &stage)?.unwrap(),
                ));
            }
            Ok(Group { name, objects, faces })
        });
        let groups = groups.collect::<Result<_>>()?;
        let (samples, truncation) = (self.samples.clone(), self.truncation);
        Ok(Visibility { samples, size, basis, truncation, lit_only: true, groups, edits: Vec::new() })
    }

    /// Rows of one group in another basis, from those in runs: without drawing again.
    pub fn encode(&self, runs: &Visibility, basis: Basis) -> Visibility {
        let size = runs.size;
        let mut groups = runs.groups.clone();
        for (face, rows) in groups[0].faces.iter_mut().enumerate().filter(|(_, rows)| rows.is_some()) {
            let first = Cell::new(0);
            let draw = |points: &[SurfacePoint], face, size: usize, _: Option<&[u32]>| {
                let start = first.replace(first.get() + points.len());
                let mut masks = vec![0; points.len() * size * size / 32];
                masks.par_chunks_mut(size * size / 32).enumerate().for_each(|(i, mask)| {
                    runs.open(start + i, face, &mut Scratch::default(), mask);
                });
                Ok(masks)
            };
            let settings = Settings { face, size, basis, truncation: self.truncation };
            let stage = Progress::silent().stage("", 0);
            *rows = Some(Arc::new(
                bake::face(&draw, &self.samples.points, &settings, None, None, &stage).unwrap().unwrap(),
            ));
        }
        Visibility { basis, truncation: self.truncation, groups, ..runs.clone() }
    }

    pub fn stage<'a>(&'a self, visibility: &'a Visibility) -> Stage<'a> {
        Stage { device: &Device::Cpu, memo: &self.memory, visibility, transport: &self.transport }
    }

    /// Irradiance at the samples.
    pub fn light(&self, visibility: &Visibility) -> Vec<[f32; 4]> {
        let stage = self.stage(visibility);
        stage.irradiance(&stage.shadows().unwrap(), None).unwrap()
    }
}

/// Radiance by direction.
pub fn environment(size: usize, radiance: impl Fn(glam::Vec3) -> [f32; 3]) -> Environment {
    let texel = |i: usize| {
        let [r, g, b] = radiance(cube::texel_point(i, size).normalize());
        [r, g, b, 0.0]
    };
    Environment::new(size, (0..FACES * size * size).map(texel).collect()).unwrap()
}

/// A sky with a sun, a lamp and a dim ground; no light from the left face.
pub fn sky(size: usize) -> Environment {
    environment(size, |w| {
        if cube::project(w).0 == 1 {
            return [0.0; 3];
        }
        let spot = |towards: glam::Vec3, width: f32| ((w.dot(towards.normalize()) - 1.0) / width).exp();
        let sun = 60.0 * spot(glam::vec3(0.5, 1.0, 0.3), 0.004);
        let lamp = 20.0 * spot(glam::vec3(0.2, 0.3, 1.0), 0.02);
        let dome = 0.3 + 0.3 * w.y;
        [sun + lamp + dome, 0.8 * sun + 0.2 * lamp + dome, 0.5 * sun + 1.5 * dome]
    })
}

/// A floor of 4 x 4 m and nothing else, seen from above.
pub fn plane() -> Scene {
    use chiaro::scene::geometry::{GeometryBuilder, Mesh};
    use chiaro::scene::{Camera, Material};
    let mut builder = GeometryBuilder::default();
    let floor = builder.object("floor");
    let corners = [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]];
    let mesh = Mesh { positions: &corners, normals: None, uvs: None, indices: &[0, 1, 2, 0, 2, 3], material: 0 };
    builder.add(floor, &mesh, glam::Mat4::from_rotation_z(0.2)).unwrap();
    let camera = Camera::look_at("main", glam::vec3(0.3, 4.0, 1.0), glam::Vec3::ZERO, 0.9);
    Scene {
        geometry: Arc::new(builder.finish(vec!["floor".to_owned()]).unwrap()),
        materials: Arc::new(vec![Material::matte([0.5; 3])]),
        lights: Arc::default(),
        cameras: Arc::new(vec![camera]),
    }
}
