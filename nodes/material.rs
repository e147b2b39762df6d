//! Changes what surfaces are made of: colour, gloss, emission. Where they lie stays, so no transfer is computed again.

use crate::names;
use crate::node::{Facet, FacetRule, Info, Inputs, Job, Node, Port};
use crate::scene::{Material as MaterialValue, Scene};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is not given stays as it is in the scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Materials to change, by name; * and ? are wildcards. None: all materials of the scene.
    pub materials: Vec<String>,
    /// Reflectance, [0, 1], linear Rec.709. It takes the place of the material's colour and of its texture.
    pub base_colour: Option<[f32; 3]>,
    /// 0 is a mirror, 1 has the widest highlights.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughness: Option<f32>,
    /// 1 reflects with its base colour and has no diffuse reflectance. It takes the place of the material's texture, too.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub metallic: Option<f32>,
    /// Strength of the highlights of what is not a metal; 0 is matte.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub specular: Option<f32>,
    /// Emitted radiance, linear Rec.709: above 0 the surfaces become lights.
    #[schemars(extend("unit" = "W/(sr m²)"))]
    pub emission: Option<[f32; 3]>,
}

impl Node for Material {
    const INFO: Info = Info {
        name: "material",
        category: "in and out",
        summary: "Changes the colour, gloss or emission of materials; costs no new transfer",
        inputs: &[Port::new("scene", Kind::Scene, "The scene whose materials change")],
        outputs: &[Port::new("scene", Kind::Scene, "The scene with the changed materials")],
        facets: &[
            FacetRule::Keeps(Facet::Geometry, "scene"),
            FacetRule::From(Facet::Materials, &[("scene", &[Facet::Materials])]),
            FacetRule::Keeps(Facet::Lights, "scene"),
            FacetRule::Keeps(Facet::Cameras, "scene"),
        ],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        let single = [self.roughness, self.metallic, self.specular];
        let nothing = self.base_colour.is_none() && self.emission.is_none() && single.iter().all(Option::is_none);
        nothing.then_some("scene")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let scene = inputs.need_whole_scene("scene")?;
        self.check()?;
        let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
        let chosen = names::chosen("material", &self.materials, &names)?;
        let change = |(material, chosen): (&MaterialValue, &bool)| match chosen {
            true => self.changed(material),
            false => material.clone(),
        };
        let materials = scene.materials.iter().zip(&chosen).map(change).collect();
        job.note("materials", chosen.iter().filter(|chosen| **chosen).count());
        Ok(vec![Value::Scene(Arc::new(Scene { materials: Arc::new(materials), ..(**scene).clone() }))])
    }
}

impl Material {
    /// What a range cannot say in the schema; and what comes by a curve.
    fn check(&self) -> Result<()> {
        let single = [("roughness", self.roughness), ("metallic", self.metallic), ("specular", self.specular)];
        let single = single.iter().map(|(name, value)| (*name, value.as_slice(), 1.0));
        let colours = [
            ("base_colour", self.base_colour.as_ref().map_or(&[][..], |colour| colour), 1.0),
            ("emission", self.emission.as_ref().map_or(&[][..], |colour| colour), f32::MAX),
        ];
        for (name, values, most) in single.chain(colours) {
            if let Some(value) = values.iter().find(|value| !(0.0..=most).contains(*value)) {
                let range = if most == 1.0 { "from 0 to 1" } else { "0 or more" };
                let help = "a surface cannot reflect more light than it gets, nor less than none";
                return Err(Error::compute(format!("{name} is {value}; it must be {range}"), help));
            }
        }
        Ok(())
    }

    fn changed(&self, old: &MaterialValue) -> MaterialValue {
        let mut new = old.clone();
        if let Some(colour) = self.base_colour {
            (new.base_colour, new.base_colour_texture) = (colour, None);
        }
        if let Some(metallic) = self.metallic {
            (new.metallic, new.metallic_texture) = (metallic, None);
        }
        new.roughness = self.roughness.unwrap_or(old.roughness);
        new.specular = self.specular.unwrap_or(old.specular);
        new.emission = self.emission.unwrap_or(old.emission);
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::texture::{Picture, Texture};

    fn textured() -> MaterialValue {
        let identity = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        let colour = Picture::colour(1, 1, vec![[0.5, 0.25, 0.125]]);
        let metal = Picture::grey(1, 1, vec![0.5]);
        MaterialValue {
            base_colour_texture: Some(Texture { picture: colour, uv_from_uv: identity }),
            metallic: 1.0,
            metallic_texture: Some(Texture { picture: metal, uv_from_uv: identity }),
            roughness: 0.3,
            specular: 0.7,
            emission: [1.0, 2.0, 3.0],
            ..MaterialValue::matte([1.0; 3])
        }
    }

    #[test]
    fn what_is_not_given_stays() {
        let old = textured();
        let rough = Material { roughness: Some(0.9), ..Material::default() }.changed(&old);
        assert_eq!((rough.roughness, rough.specular, rough.emission), (0.9, 0.7, [1.0, 2.0, 3.0]));
        assert_eq!(rough.reflectance([0.0; 2]), [0.25, 0.125, 0.0625]);
    }

    #[test]
    fn what_is_given_takes_the_place_of_textures() {
        let old = textured();
        let green = Material { base_colour: Some([0.0, 0.5, 0.0]), ..Material::default() }.changed(&old);
        assert_eq!(green.reflectance([0.0; 2]), [0.0, 0.25, 0.0], "still half a metal");
        let wood = Material { metallic: Some(0.0), ..Material::default() }.changed(&old);
        assert_eq!(wood.reflectance([0.0; 2]), [0.5, 0.25, 0.125]);
        assert!(!Material { metallic: Some(0.0), ..Material::default() }.changed(&green).is_textured());
    }

    #[test]
    fn impossible_surfaces_are_refused() {
        let refused = |material: Material| material.check().unwrap_err().to_string();
        let bright = refused(Material { base_colour: Some([0.5, 1.5, 0.5]), ..Material::default() });
        assert!(bright.contains("base_colour is 1.5") && bright.contains("from 0 to 1"), "{bright}");
        refused(Material { roughness: Some(-0.1), ..Material::default() });
        refused(Material { metallic: Some(f32::NAN), ..Material::default() });
        refused(Material { specular: Some(2.0), ..Material::default() });
        refused(Material { emission: Some([0.0, -1.0, 0.0]), ..Material::default() });
        refused(Material { emission: Some([f32::INFINITY; 3]), ..Material::default() });
        let good =
            Material { base_colour: Some([0.0, 1.0, 0.5]), emission: Some([0.0, 100.0, 0.0]), ..Material::default() };
        assert!(good.check().is_ok());
    }
}
