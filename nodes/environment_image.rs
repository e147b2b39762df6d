//! Shows an environment as a picture, and which part of it is a light, or is seen by samples.

use crate::image::{Content, Image, Layer};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::scene::{Environment, cube};
use crate::transport::Selection;
use crate::transport::shadow::{Lamp, Visibility, edited};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// Radiance that is left where no light was found, so that the light is seen.
const DIMMED: f32 = 0.1;

/// Latitude-longitude, laid out as the maps that `environment` reads: +X in the centre, +Z to its right, +Y on top.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EnvironmentImage {
    /// Of the picture, which is half as high.
    #[schemars(range(min = 2, max = 16384), extend("unit" = "pixels"))]
    pub width: u32,
}

impl Default for EnvironmentImage {
    fn default() -> Self {
        Self { width: 512 }
    }
}

impl Node for EnvironmentImage {
    const INFO: Info = Info {
        name: "environment_image",
        category: "in and out",
        summary: "An environment as a latitude-longitude picture: all of it, a light in it, or what samples see",
        inputs: &[
            Port::new("environment", Kind::Environment, "What is shown"),
            Port::new("light", Kind::Light, "The environment is a tenth as bright where this is 0").optional(),
            Port::new("visibility", Kind::Visibility, "With `selection`: a tenth as bright where those do not see it")
                .optional(),
            Port::new("selection", Kind::Selection, "The samples whose view is shown, edits of shadows included")
                .optional(),
        ],
        outputs: &[Port::new(
            "image",
            Kind::Image,
            "Beauty; with a light the layer `light`: its weights; with visibility the layer `seen`: the share that is seen",
        )],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (environment, lamp) = (inputs.need_environment("environment")?, inputs.light("light"));
        if let Some(lamp) = lamp {
            lamp.check(environment.size)?;
        }
        let seen = match (inputs.visibility("visibility"), inputs.selection("selection")) {
            (Some(visibility), Some(selection)) => Some(seen(job, environment, visibility, selection)?),
            (None, None) => None,
            _ => {
                let message = "only one of `visibility` and `selection` is connected";
                return Err(Error::compute(message, "connect both to see what selected samples see, or neither"));
            }
        };
        let shown = Shown { environment, lamp: lamp.map(|lamp| &**lamp), seen: seen.as_deref() };
        Ok(vec![Value::Image(Arc::new(picture(&shown, self.width as usize)))])
    }
}

fn seen(job: &Job, environment: &Environment, visibility: &Visibility, selection: &Selection) -> Result<Vec<[f32; 3]>> {
    if visibility.size != environment.size {
        let (ours, theirs) = (environment.size, visibility.size);
        let message = format!("the environment has faces of {ours} x {ours} texels, visibility of {theirs} x {theirs}");
        return Err(Error::compute(message, "set face_size of both nodes to the same number"));
    }
    selection.check(&visibility.samples.geometry)?;
    let weights = selection.weights(&visibility.samples.points);
    edited::seen(job.device, job.progress, visibility, environment, &weights)
}

struct Shown<'a> {
    environment: &'a Environment,
    lamp: Option<&'a Lamp>,
    /// Share of each texel, RGB.
    seen: Option<&'a [[f32; 3]]>,
}

fn picture(shown: &Shown, width: usize) -> Image {
    let (environment, size, width) = (shown.environment, shown.environment.size, width.max(2));
    let height = width / 2;
    // Texels are no narrower than 0.88 / size radians; each is met at least twice across.
    let fine = (2.0 * TAU / width as f32 * size as f32 / 0.88).ceil().max(2.0) as usize;
    let dimmed = |weight: f32| DIMMED + (1.0 - DIMMED) * weight;
    // Beauty, light, seen.
    let at = |x: usize, y: usize| {
        let mut sum = [0.0; 7];
        for i in 0..fine * fine {
            let across = (x as f32 + ((i % fine) as f32 + 0.5) / fine as f32) / width as f32;
            let down = (y as f32 + ((i / fine) as f32 + 0.5) / fine as f32) / height as f32;
            let ((sin, cos), (up, out)) = (((across - 0.5) * TAU).sin_cos(), ((0.5 - down) * PI).sin_cos());
            let texel = cube::texel_at(Vec3::new(out * cos, up, out * sin), size);
            let weight = shown.lamp.map_or(1.0, |lamp| lamp.weights[texel]);
            let seen = shown.seen.map_or([1.0; 3], |seen| seen[texel]);
            (0..3).for_each(|c| sum[c] += environment.radiance[texel][c] * dimmed(weight) * dimmed(seen[c]));
            sum[3] += weight;
            (0..3).for_each(|c| sum[4 + c] += seen[c]);
        }
        sum.map(|x| x / (fine * fine) as f32)
    };
    let pixels: Vec<[f32; 7]> = (0..width * height).into_par_iter().map(|i| at(i % width, i / width)).collect();
    let layer = |name: &str, channels: &[&str], content: Content, first: usize| {
        let data = pixels.iter().flat_map(|pixel| &pixel[first..first + channels.len()]).copied().collect();
        Layer::new(name, channels, content, data)
    };
    let mut layers = vec![layer("", &["R", "G", "B"], Content::Colour, 0)];
    layers.extend(shown.lamp.map(|_| layer("light", &["Y"], Content::Data, 3)));
    layers.extend(shown.seen.map(|_| layer("seen", &["R", "G", "B"], Content::Data, 4)));
    Image { width, height, layers, ..Image::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LatLong;

    #[test]
    fn a_map_drawn_is_the_map() {
        // Four by two pixels, so coarse that only pixels of the picture at their borders mix.
        let pixels: Vec<[f32; 3]> = (0..8).map(|i| [i as f32, 1.0, 70_000.0]).collect();
        let environment = LatLong::new(4, 2, pixels).unwrap().cube(64, 0.0, 1.0).unwrap();
        let image = picture(&Shown { environment: &environment, lamp: None, seen: None }, 64);
        assert_eq!((image.width, image.height, image.layers.len()), (64, 32, 1));
        for i in 0..8 {
            let (x, y) = (16 * (i % 4) + 8, 16 * (i / 4) + 8);
            let pixel = &image.layers[0].data[3 * (64 * y + x)..][..3];
            assert!((pixel[0] - i as f32).abs() < 1e-5 && (pixel[2] - 70_000.0).abs() < 0.1, "{i}: {pixel:?}");
        }
    }

    #[test]
    fn what_is_no_light_is_dimmed() {
        let environment = LatLong::new(2, 1, vec![[1.0; 3]; 2]).unwrap().cube(32, 0.0, 1.0).unwrap();
        let face = 32 * 32;
        // The right face, half of the left one.
        let weights: Vec<f32> = (0..6 * face).map(|texel| [1.0, 0.5, 0.0, 0.0, 0.0, 0.0][texel / face]).collect();
        let lamp = Lamp { size: 32, weights: weights.into() };
        let image = picture(&Shown { environment: &environment, lamp: Some(&lamp), seen: None }, 32);
        let (beauty, light) = (image.layer("").unwrap(), image.layer("light").unwrap());
        for (x, y, shown, weight) in [(16, 8, 1.0, 1.0), (0, 8, 0.55, 0.5), (24, 8, 0.1, 0.0), (5, 0, 0.1, 0.0)] {
            assert!((beauty.data[3 * (32 * y + x)] - shown).abs() < 1e-5);
            assert!((light.data[32 * y + x] - weight).abs() < 1e-5);
        }
    }
}
