//! Cryptomatte of our own pictures: which objects and materials each pixel shows, for any compositor to key by name.

use super::merge::same_size;
use crate::image::{Image, cryptomatte};
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Layers `CryptoObject00` to `02` and `CryptoMaterial00` to `02` (Cryptomatte 1.2). Coverage is the share of a pixel's
/// samples: one sample a pixel gives hard edges, 16 or more are smooth.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Cryptomatte {
    /// Write `CryptoObject`.
    pub objects: bool,
    /// Write `CryptoMaterial`.
    pub materials: bool,
    /// How many objects a pixel can hold, two to a layer.
    #[schemars(range(min = 2, max = 64))]
    pub ranks: u32,
}

impl Default for Cryptomatte {
    fn default() -> Self {
        Self { objects: true, materials: true, ranks: 6 }
    }
}

impl Node for Cryptomatte {
    const INFO: Info = Info {
        name: "cryptomatte",
        category: "image",
        summary: "Which objects and materials pixels show, as layers that compositors key by name",
        inputs: &[
            Port::new("scene", Kind::Scene, "What is seen").reads(&[Facet::Geometry]),
            Port::new("samples", Kind::Samples, "The view: the more samples a pixel, the smoother its edges")
                .reads(&[Facet::Geometry]),
            Port::new("image", Kind::Image, "The picture that gets the layers; without it, a picture of them alone")
                .optional(),
        ],
        outputs: &[Port::new("image", Kind::Image, "The picture with the layers")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let geometry = inputs.geometry("scene")?;
        let samples = inputs.need_whole_samples("samples")?;
        samples.check(&geometry)?;
        if !self.objects && !self.materials {
            return Err(Error::compute("neither objects nor materials are asked for", "set one of them to true"));
        }
        let alone = Image { width: samples.width, height: samples.height, ..Image::default() };
        let mut image = match inputs.image("image") {
            Some(image) => {
                same_size(&alone, image, ["samples", "image"])?;
                (**image).clone()
            }
            None => alone,
        };
        let objects: Vec<u32> = samples.points.iter().map(|point| point.object).collect();
        let materials: Vec<u32> = samples.points.iter().map(|point| point.material).collect();
        let mattes = [
            ("CryptoObject", self.objects, &geometry.objects, objects),
            ("CryptoMaterial", self.materials, &geometry.material_names, materials),
        ];
        for (matte, _, names, shown) in mattes.iter().filter(|(_, wanted, ..)| *wanted) {
            if let Some(layer) = image.layers.iter().find(|layer| layer.name.starts_with(matte)) {
                let message = format!("the picture has a layer \"{}\" already", layer.name);
                return Err(Error::compute(message, "leave it out, or take its layers off with write_image"));
            }
            let ranked = cryptomatte::rank(matte, names, shown, samples.per_pixel(), self.ranks as usize);
            if ranked.cut > 0 {
                job.warn(format!("{matte}: {} pixels show more than {} of them", ranked.cut, self.ranks));
            }
            for name in &ranked.collisions {
                job.warn(format!("{matte}: \"{name}\" has the same id as another; they cannot be told apart"));
            }
            job.note(&format!("{matte} pixels with more than ranks"), ranked.cut);
            image.layers.extend(ranked.layers);
            // Headers of a matte of that name whose layers are gone.
            let key = cryptomatte::header_key(matte);
            let stale = |(name, value): &(String, String)| name.ends_with("/name") && value == matte;
            let mut keys: Vec<String> =
                image.metadata.iter().filter(|field| stale(field)).map(|(name, _)| name.clone()).collect();
            keys.push(format!("{key}/name"));
            let keys: Vec<&str> = keys.iter().filter_map(|name| name.strip_suffix("name")).collect();
            image.metadata.retain(|(name, _)| !keys.iter().any(|key| name.starts_with(key)));
            image.metadata.extend(ranked.metadata);
        }
        Ok(vec![Value::Image(Arc::new(image))])
    }
}
