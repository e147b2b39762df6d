//! What a viewer has to show: a picture of a value, and what its pixels lie on.

use super::hands::shadow::direction;
use crate::image::{Content, Image, Layer};
use crate::scene::{Environment, Scene, SurfacePoint, cube};
use crate::transport::samples::reflectance;
use crate::transport::selection::Weighed;
use crate::transport::shadow::Ratio;
use crate::transport::{Samples, Selection};
use crate::value::Value;
use crate::{Error, Result};
use glam::{Vec3, Vec4};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

#[derive(Clone)]
pub struct Shown {
    pub picture: Arc<Image>,
    /// Of the same size, or another one.
    pub other: Option<Arc<Image>>,
    /// What pixels of the picture see; of as many pixels.
    pub samples: Option<Arc<Samples>>,
    pub scene: Option<Arc<Scene>>,
    /// Weight of a selection in each pixel, [0, 1].
    pub mask: Option<Arc<Vec<f32>>>,
    /// Where the light of the shadow that is edited comes from: unit, world.
    pub light: Option<Vec3>,
}

/// What was computed for a viewer.
#[derive(Default)]
pub struct Parts {
    pub picture: Option<Value>,
    pub other: Option<Value>,
    pub mask: Option<Value>,
    pub samples: Option<Value>,
    pub scene: Option<Value>,
    pub lamp: Option<Value>,
    pub environment: Option<Value>,
}

/// The mask that was shown last: the next one often differs little from it.
#[derive(Default)]
pub struct LastMask(Option<(Arc<Samples>, Weighed)>);

impl LastMask {
    /// Weight of each pixel.
    fn follow(&mut self, samples: &Arc<Samples>, selection: &Arc<Selection>) -> Vec<f32> {
        let before = self.0.as_ref().filter(|(before, _)| Arc::ptr_eq(before, samples));
        let weighed = Weighed::new(selection, &samples.points, before.map(|(_, weighed)| weighed));
        let weights = samples.resolve(|i| weighed.weights[i]);
        self.0 = Some((samples.clone(), weighed));
        weights
    }
}

impl Shown {
    /// # Errors
    /// `Usage` when the value is of a kind that has no picture.
    pub fn new(parts: Parts, last: &mut LastMask) -> Result<Self> {
        let samples = match parts.samples {
            Some(Value::Samples(samples)) => Some(samples),
            _ => None,
        };
        let scene = match parts.scene {
            Some(Value::Scene(scene)) => Some(scene),
            _ => None,
        };
        let picture = parts.picture.and_then(|value| picture(&value, scene.as_deref()));
        let picture = picture.ok_or_else(|| Error::usage("there is no picture of this", "view another node"))?;
        let same_size = |samples: &Arc<Samples>| (samples.width, samples.height) == (picture.width, picture.height);
        let samples = samples.filter(same_size);
        let mask = match (&parts.mask, &samples) {
            (Some(Value::Selection(selection)), Some(samples)) if *selection.geometry() == samples.geometry => {
                Some(Arc::new(last.follow(samples, selection)))
            }
            _ => None,
        };
        let other = parts.other.and_then(|value| self::picture(&value, scene.as_deref()));
        let light = match (&parts.environment, &parts.lamp) {
            (Some(Value::Environment(environment)), Some(Value::Light(lamp))) => direction(environment, Some(lamp)),
            (Some(Value::Environment(environment)), None) => direction(environment, None),
            _ => None,
        };
        Ok(Self { picture, other, samples, scene, mask, light })
    }

    /// What a pixel sees: the sample in its middle, if it meets a surface.
    pub fn point(&self, x: usize, y: usize) -> Option<&SurfacePoint> {
        let samples = self.samples.as_ref()?;
        let per_pixel = samples.per_pixel();
        let point = samples.points.get((y * samples.width + x) * per_pixel + per_pixel / 2)?;
        (x < samples.width && point.exists()).then_some(point)
    }

    /// Name of an object.
    pub fn object(&self, point: &SurfacePoint) -> &str {
        let names = self.scene.as_ref().map(|scene| &scene.geometry.objects);
        names.and_then(|names| names.get(point.object as usize)).map_or("", String::as_str)
    }

    pub fn material(&self, point: &SurfacePoint) -> &str {
        let names = self.scene.as_ref().map(|scene| &scene.geometry.material_names);
        names.and_then(|names| names.get(point.material as usize)).map_or("", String::as_str)
    }
}

/// `None` for values that have none.
fn picture(value: &Value, scene: Option<&Scene>) -> Option<Arc<Image>> {
    match value {
        Value::Image(image) => Some(image.clone()),
        Value::Samples(samples) => Some(Arc::new(clay(samples, scene))),
        Value::Environment(environment) => Some(Arc::new(map(environment, 4 * environment.size))),
        Value::Ratio(ratio) => Some(Arc::new(factors(ratio))),
        _ => None,
    }
}

/// Light that surfaces show of a lamp at the camera where they are turned away from it.
const AMBIENT: f32 = 0.25;

/// The surfaces as a lamp at the camera shows them, without shadows; with position (m), normal and distance (m).
pub fn clay(samples: &Samples, scene: Option<&Scene>) -> Image {
    let eye = samples.camera.position;
    let of = scene.filter(|scene| scene.geometry.fingerprint == samples.geometry);
    let colours =
        of.map(|scene| reflectance(&scene.geometry, &scene.materials, &samples.points, &samples.barycentrics));
    let points = &samples.points;
    let lit = samples.resolve(|i| {
        let point = &points[i];
        if !point.exists() {
            return Vec4::ZERO;
        }
        let colour = colours.as_ref().map_or(Vec3::splat(0.5), |colours| Vec4::from(colours[i]).truncate());
        let way = (eye - Vec3::from(point.position)).normalize_or_zero();
        // Texels are seen from nowhere: all alike.
        let facing = if samples.atlas.is_some() { 1.0 } else { way.dot(point.normal.into()).abs() };
        // Black and glossy things are to be seen, too.
        (colour.max(Vec3::splat(0.08)) * (AMBIENT + (1.0 - AMBIENT) * facing)).extend(1.0)
    });
    let per_pixel = samples.per_pixel();
    let middle = |pixel: usize| &points[pixel * per_pixel + per_pixel / 2];
    let data = |of: &dyn Fn(&SurfacePoint) -> Vec<f32>| (0..lit.len()).flat_map(|pixel| of(middle(pixel))).collect();
    let distance = |point: &SurfacePoint| if point.exists() { eye.distance(point.position.into()) } else { 0.0 };
    let layers = vec![
        Layer::new("", &["R", "G", "B", "A"], Content::Colour, lit.iter().flat_map(Vec4::to_array).collect()),
        Layer::new("P", &["X", "Y", "Z"], Content::Data, data(&|point| point.position.to_vec())),
        Layer::new("N", &["X", "Y", "Z"], Content::Data, data(&|point| point.normal.to_vec())),
        Layer::new("Z", &["Z"], Content::Data, data(&|point| vec![distance(point)])),
    ];
    Image { width: samples.width, height: samples.height, layers, ..Image::default() }
}

/// Of an environment, latitude over longitude, as `environment_image` lays it out.
pub fn map(environment: &Environment, width: usize) -> Image {
    let (width, height) = (width.max(2), (width / 2).max(1));
    let at = |i: usize| {
        let across = ((i % width) as f32 + 0.5) / width as f32;
        let down = ((i / width) as f32 + 0.5) / height as f32;
        let ((sin, cos), (up, out)) = (((across - 0.5) * TAU).sin_cos(), ((0.5 - down) * PI).sin_cos());
        environment.radiance[cube::texel_at(Vec3::new(out * cos, up, out * sin), environment.size)]
    };
    let data = (0..width * height).flat_map(|i| at(i).into_iter().take(3)).collect();
    Image { width, height, layers: vec![Layer::new("", &["R", "G", "B"], Content::Colour, data)], ..Image::default() }
}

fn factors(ratio: &Ratio) -> Image {
    let data = ratio.values.iter().flatten().copied().collect();
    let layers = vec![Layer::new("", &["R", "G", "B", "A"], Content::Colour, data)];
    Image { width: ratio.width, height: ratio.height, layers, ..Image::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::scene::{Camera, builtin};
    use crate::transport::selection::{Grounds, Stroke, StrokeMode};

    /// Whatever was shown before: another stroke, or another view of as many pixels.
    #[test]
    fn a_mask_follows_from_the_last_one() {
        let geometry = builtin::scene("room").unwrap().geometry;
        let view = |x: f32| {
            let camera = Camera::look_at("", Vec3::new(x, 1.0, 0.9), Vec3::ZERO, 1.0);
            Arc::new(Samples::view(&Device::Cpu, &geometry, &camera, (64, 48), 4).unwrap())
        };
        let (left, right) = (view(-0.3), view(0.3));
        let painted = |points: usize| {
            let points = (0..points).map(|i| [0.1 * i as f32 - 0.3, 0.0, 0.0]).collect();
            let (normals, mode) = (Vec::new(), StrokeMode::Add);
            let stroke = Stroke {
                points,
                normals,
                radius: 0.2,
                hardness: 0.5,
                value: 1.0,
                mode,
                adaptive: false,
                attached: None,
            };
            Arc::new(
                Selection::painted(&Grounds::still(geometry.clone()), &[stroke], |_, _| unreachable!("it is not"))
                    .unwrap()
                    .0,
            )
        };
        let mut last = LastMask::default();
        for (samples, points) in [(&left, 1), (&left, 2), (&right, 2), (&right, 4), (&left, 3)] {
            let selection = painted(points);
            let mask = last.follow(samples, &selection);
            let weights = selection.weights(&samples.points);
            let mean = |pixel: usize| weights[4 * pixel..4 * pixel + 4].iter().sum::<f32>() / 4.0;
            assert_eq!(mask, (0..64 * 48).map(mean).collect::<Vec<_>>(), "{points} points");
            assert!(mask.iter().any(|weight| *weight > 0.0));
        }
    }
}
