//! Applies a change that is seen in a preview to a renderer's plate (thesis 6.7.4).

use super::merge::same_size;
use crate::image::components::{self, Component, Named};
use crate::image::{Image, Layer};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::plate::change::{self, Met, Radiance, Settings};
use crate::transport::shadow::Ratio;
use crate::transport::shadow::ratio::quotient::divide;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// By ratio where the preview has light, by difference where it is dark, smoothly in between. Where the plate keeps
/// direct and indirect light apart, and both previews do too, each light changes by itself, and the beauty by as much;
/// otherwise the beauty changes as a whole.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RatioToPlate {
    /// Light below this share of the preview's mean is dark: there the difference counts.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dark: f32,
    /// Light below this share of what the change adds is dark, too. 0 keeps textures that the preview does not have even
    /// in the depth of a lifted shadow; more keeps its edges from flaring.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub lift: f32,
    /// How many times a difference may grow where the plate is brighter than the preview.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub limit: f32,
    /// Factor that brings the preview to the plate's exposure. Absent: measured, as the median over what is lit.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub gain: Option<f32>,
    /// The plate's lights, where they have other names than those known from Blender, Arnold, Karma and RenderMan.
    pub components: Vec<Named>,
}

impl Default for RatioToPlate {
    fn default() -> Self {
        Self { dark: 0.01, lift: 0.15, limit: 8.0, gain: None, components: Vec::new() }
    }
}

impl Node for RatioToPlate {
    const INFO: Info = Info {
        name: "ratio_to_plate",
        category: "image",
        summary: "Applies a change seen in a preview to a renderer's plate",
        inputs: &[
            Port::new("plate", Kind::Image, "The renderer's picture"),
            Port::new("before", Kind::Image, "The preview without the change"),
            Port::new("after", Kind::Image, "The preview with it"),
        ],
        outputs: &[
            Port::new("image", Kind::Image, "The plate with the change; other layers as they were"),
            Port::new("ratio", Kind::Ratio, "New beauty over old: the plate's beauty times this is the new one"),
        ],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let plate = inputs.need_image("plate")?;
        let [before, after] = [inputs.need_image("before")?, inputs.need_image("after")?];
        same_size(before, plate, ["before", "plate"])?;
        same_size(after, plate, ["after", "plate"])?;
        let [before, after] = [before, after].map(|image| image.to_space(plate.colour_space));
        let mut changed: Image = (**plate).clone();
        let lights = self.lights(plate, &before, &after, job)?;
        let beauty = plate.place("").ok();
        for [own, old, new] in &lights {
            let [old, new] = [Radiance::of(&before, *old)?, Radiance::of(&after, *new)?];
            let (layer, met) = change::apply(&Radiance::of(plate, *own)?, &old, &new, self.settings());
            tell(job, &plate.layers[own.layer], &met);
            if let Some(beauty) = beauty.filter(|beauty| *beauty != own.layer) {
                let colour = own.colour.map(|at| &plate.layers[at]);
                changed.layers[beauty] =
                    change::carry(&changed.layers[beauty], &plate.layers[own.layer], &layer, colour)?;
            }
            changed.layers[own.layer] = layer;
            job.progress.check()?;
        }
        if lights.is_empty() {
            let whole =
                |image, port| whole(image).map_err(|e| Error::compute(format!("input \"{port}\": {}", e.0), e.1));
            let (at, layer) = whole(plate, "plate")?;
            let [old, new] =
                [Radiance::whole(whole(&before, "before")?.1)?, Radiance::whole(whole(&after, "after")?.1)?];
            let (new, met) = change::apply(&Radiance::whole(layer)?, &old, &new, self.settings());
            tell(job, layer, &met);
            changed.layers[at] = new;
        }
        let ratio = ratio(plate, &changed, beauty, job)?;
        Ok(vec![Value::Image(Arc::new(changed)), Value::Ratio(Arc::new(ratio))])
    }
}

impl RatioToPlate {
    fn settings(&self) -> Settings {
        Settings { dark: self.dark, lift: self.lift, limit: self.limit, gain: self.gain }
    }

    /// Lights that plate and previews have: in the plate, before, after. Empty: only the beauty tells.
    fn lights(&self, plate: &Image, before: &Image, after: &Image, job: &Job) -> Result<Vec<[Component; 3]>> {
        let own = match &self.components[..] {
            [] => components::known(plate),
            list => components::named(plate, list)?,
        };
        let [old, new] = [before, after].map(components::known);
        let of = |list: &[Component], light| list.iter().find(|component| component.light == light).copied();
        // A light that the plate does not keep apart would be lost: then the whole beauty has to tell.
        let both = old.iter().filter_map(|old| Some([*old, of(&new, old.light)?]));
        let lights: Option<Vec<[Component; 3]>> =
            both.map(|[old, new]| Some([of(&own, old.light)?, old, new])).collect();
        let lights = lights.unwrap_or_default();
        if let (true, Some(named)) = (lights.is_empty(), self.components.first()) {
            let message = format!("before and after do not both have a layer \"{}\"", named.light.name());
            return Err(Error::compute(message, "connect previews of relight or integrate, or name no components"));
        }
        job.note("lights", lights.iter().map(|[own, ..]| plate.layers[own.layer].title()).collect::<Vec<_>>());
        Ok(lights)
    }
}

type Missing = (String, String);

fn whole(image: &Image) -> std::result::Result<(usize, &Layer), Missing> {
    let at = image.place("").map_err(|e| (e.message, e.help))?;
    Ok((at, &image.layers[at]))
}

fn tell(job: &Job, layer: &Layer, met: &Met) {
    let title = layer.title();
    job.note(&format!("{title} gain"), met.gain);
    job.note(&format!("{title} changed"), met.changed);
    job.note(&format!("{title} by difference"), met.by_difference);
    job.note(&format!("{title} limited"), met.limited);
    if met.not_finite > 0 {
        job.note(&format!("{title} not finite"), met.not_finite);
        job.warn(format!("{title}: {} pixels hold NaN or infinity; they stay as they are", met.not_finite));
    }
    if 10 * met.limited > met.changed && met.limited > 0 {
        let (limited, changed) = (met.limited, met.changed);
        job.warn(format!(
            "{title}: plate and preview disagree in {limited} of {changed} changed pixels; is it the same view and light?"
        ));
    }
}

/// New over old, of the beauty or, without one, of nothing.
fn ratio(plate: &Image, changed: &Image, beauty: Option<usize>, job: &Job) -> Result<Ratio> {
    let (width, height) = (plate.width, plate.height);
    let Some(beauty) = beauty else {
        job.warn("the plate has no beauty: the ratio is 1");
        return Ok(Ratio {
            width,
            height,
            values: vec![[1.0; 4]; width * height].into(),
            colour_space: plate.colour_space,
        });
    };
    let [old, new] = [&plate.layers[beauty], &changed.layers[beauty]];
    let (values, met) = divide((new, new.need_rgb()?), (old, old.need_rgb()?));
    let lost = |(pixel, value): (usize, &[f32; 4])| {
        let [old, new] = [old, new].map(|layer| &layer.data[pixel * layer.channels.len()..][..layer.channels.len()]);
        value[3] == 0.0 && old != new
    };
    let lost = values.iter().enumerate().filter(|pixel| lost(*pixel)).count();
    job.note("ratio without effect", lost);
    if lost > 0 {
        job.warn(format!("{lost} pixels got light where the plate is black: a ratio cannot give it, the image does"));
    }
    if met.limited > 0 {
        job.note("ratio limited", met.limited);
    }
    Ok(Ratio { width, height, values: values.into(), colour_space: plate.colour_space })
}
