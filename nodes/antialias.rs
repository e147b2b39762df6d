//! Smooth edges for pictures with one sample a pixel (thesis 6.8).

use crate::image::{Content, Image, Layer};
use crate::node::{Facet, Info, Inputs, Job, Key, Node, Port};
use crate::transport::Samples;
use crate::transport::shadow::antialias::Stencils;
use crate::transport::shadow::kinship::{Kin, pixel_angle};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Takes the picture to twice its width and height along surfaces, and back. What lies within one surface is as before
/// where it is even, and as soft as the two steps make it where it is not; data layers (P, N, Z) stay.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Antialias {}

const PLACES: &[Facet] = &[Facet::Geometry];

impl Node for Antialias {
    const INFO: Info = Info {
        name: "antialias",
        category: "shadows",
        summary: "Smooths the edges of objects in a picture of one sample a pixel",
        inputs: &[
            Port::new("image", Kind::Image, "The picture"),
            Port::new(
                "samples",
                Kind::Samples,
                "The same view with twice the width and height, or with 4 samples a pixel",
            )
            .reads(PLACES),
            Port::new("view", Kind::Samples, "What the picture was made from; without it, its layers P and N say so")
                .optional()
                .reads(PLACES),
        ],
        outputs: &[Port::new("image", Kind::Image, "The picture with smooth edges")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (image, fine) = (inputs.need_image("image")?, inputs.need_whole_samples("samples")?);
        check_size(image, fine)?;
        let key = inputs.key("samples", Facet::Geometry).expect("it is connected");
        let stencils = match inputs.whole_samples("view") {
            Some(view) => {
                check_view(image, fine, view)?;
                let own = inputs.key("view", Facet::Geometry).expect("it is connected");
                let compute = || Ok(Stencils::new(fine, &Kin::of_pixels(view)));
                job.memo(Key::of(&[b"stencils", &key.0, &own.0]), Stencils::bytes, compute)?
            }
            None => {
                let (place, normal) = (vectors(image, "P")?, vectors(image, "N")?);
                // Layers keep their identity for as long as surfaces stay where they are.
                let own = [place.data.id().to_le_bytes(), normal.data.id().to_le_bytes()];
                let compute = || Ok(Stencils::new(fine, &kin(place, normal, fine, image.height)));
                job.memo(Key::of(&[b"stencils of layers", &key.0, own.as_flattened()]), Stencils::bytes, compute)?
            }
        };
        let mut smooth = (**image).clone();
        let mut not_finite = 0;
        for layer in smooth.layers.iter_mut().filter(|layer| layer.content == Content::Colour) {
            let (data, bad) = stencils.apply(layer);
            *layer = layer.with_data(data);
            not_finite = bad.max(not_finite);
        }
        job.note("unmatched_samples", stencils.unmatched);
        if not_finite > 0 {
            job.note("not_finite", not_finite);
            job.warn(format!("{not_finite} pixels hold NaN or infinity; they stay as they are"));
        }
        Ok(vec![Value::Image(Arc::new(smooth))])
    }
}

fn check_size(image: &Image, fine: &Samples) -> Result<()> {
    if [fine.width * fine.across, fine.height * fine.down] == [2 * image.width, 2 * image.height] {
        return Ok(());
    }
    let (w, h, n) = (fine.width, fine.height, fine.per_pixel());
    let message =
        format!("the picture has {} x {} pixels, samples {w} x {h} with {n} a pixel", image.width, image.height);
    let help = format!(
        "give samples of {} x {}, or of {} x {} with samples_per_pixel 4",
        2 * image.width,
        2 * image.height,
        image.width,
        image.height
    );
    Err(Error::compute(message, help))
}

fn check_view(image: &Image, fine: &Samples, view: &Samples) -> Result<()> {
    if (view.width, view.height) != (image.width, image.height) {
        let size =
            format!("the picture has {} x {} pixels, view {} x {}", image.width, image.height, view.width, view.height);
        return Err(Error::compute(size, "connect the samples that the picture was made from"));
    }
    let (a, b) = (&fine.camera, &view.camera);
    if (a.position, a.world_from_camera, a.fov_y) != (b.position, b.world_from_camera, b.fov_y) {
        return Err(Error::compute("samples and view have different cameras", "give both the same camera"));
    }
    if fine.geometry != view.geometry {
        return Err(Error::compute("samples and view lie on different scenes", "give both the same scene"));
    }
    Ok(())
}

fn vectors<'a>(image: &'a Image, name: &str) -> Result<&'a Layer> {
    let help = "connect the samples that the picture was made from to view";
    match image.layer(name) {
        Some(layer) if layer.channels.len() == 3 => Ok(layer),
        Some(layer) => Err(Error::compute(format!("layer {name} has {}, not X Y Z", layer.channels.join(" ")), help)),
        None => Err(Error::compute(format!("the picture has no layer {name}, and there is no view"), help)),
    }
}

/// What a pixel saw, by its layers.
fn kin<'a>(place: &'a Layer, normal: &'a Layer, fine: &'a Samples, height: usize) -> impl Fn(usize) -> Kin + Sync + 'a {
    let angle = pixel_angle(&fine.camera, height);
    move |pixel| {
        let position = Vec3::from_slice(&place.data[3 * pixel..]);
        let depth = (fine.camera.position - position).dot(fine.camera.world_from_camera.z_axis).abs();
        let normal = Vec3::from_slice(&normal.data[3 * pixel..]);
        Kin { position, normal, object: None, footprint: depth * angle }
    }
}
