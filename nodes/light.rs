//! Adds a light to a scene, or changes the one of that name.

use crate::node::{Facet, FacetRule, Info, Inputs, Job, Node, Port};
use crate::scene::{Light as LightValue, LightKind, Scene};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// From one place in all directions; intensity in W/sr.
    Point,
    /// From one place within a cone; intensity in W/sr.
    Spot,
    /// Parallel light from far away; intensity in W/m² on a facing surface.
    Directional,
    /// A rectangle; intensity in W/(sr m²).
    Area,
}

/// What is not given stays as it is in the scene's light, or takes the value in parentheses in a new one.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Light {
    /// The light of the scene to change; a new one is added when there is none of this name.
    pub name: String,
    /// (point)
    pub kind: Option<Shape>,
    /// (0, 2, 0) Centre of an area light.
    #[schemars(extend("unit" = "m"))]
    pub position: Option<[f32; 3]>,
    /// (0, -1, 0) The way light travels.
    pub direction: Option<[f32; 3]>,
    /// (1, 1, 1) Linear Rec.709.
    pub colour: Option<[f32; 3]>,
    /// (10) In the unit of the kind. Given alone to a black light, it shines white.
    #[schemars(range(min = 0.0))]
    pub intensity: Option<f32>,
    /// (45) Half angle of a spot's cone.
    #[schemars(range(min = 0.1, max = 90.0), extend("unit" = "degrees"))]
    pub cone: Option<f32>,
    /// (0.15) Share of the cone's angle over which a spot fades out.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub softness: Option<f32>,
    /// (1, 1) Edges of an area light.
    #[schemars(extend("unit" = "m"))]
    pub size: Option<[f32; 2]>,
    /// Off: the light of this name is taken out.
    pub on: bool,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            name: "light".into(),
            kind: None,
            position: None,
            direction: None,
            colour: None,
            intensity: None,
            cone: None,
            softness: None,
            size: None,
            on: true,
        }
    }
}

impl Node for Light {
    const INFO: Info = Info {
        name: "light",
        category: "in and out",
        summary: "Adds a light to a scene, or changes the one of that name",
        inputs: &[Port::new(
            "scene",
            Kind::Scene,
            "Where the light goes; without it, the output holds the light alone",
        )
        .optional()],
        outputs: &[Port::new("scene", Kind::Scene, "The scene with the light")],
        facets: &[
            FacetRule::Keeps(Facet::Geometry, "scene"),
            FacetRule::Keeps(Facet::Materials, "scene"),
            FacetRule::Keeps(Facet::Cameras, "scene"),
        ],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let scene = inputs.whole_scene("scene").map(|scene| (**scene).clone()).unwrap_or_default();
        let mut lights: Vec<LightValue> = scene.lights.to_vec();
        let at = lights.iter().position(|light| light.name == self.name);
        match (at, self.on) {
            (Some(at), true) => lights[at] = self.changed(Some(&lights[at]))?,
            (Some(at), false) => {
                lights.remove(at);
            }
            (None, true) => lights.push(self.changed(None)?),
            (None, false) => {}
        }
        Ok(vec![Value::Scene(Arc::new(Scene { lights: Arc::new(lights), ..scene }))])
    }
}

/// All that any kind of light has.
struct All {
    shape: Shape,
    position: Vec3,
    direction: Vec3,
    intensity: Vec3,
    inner: f32,
    outer: f32,
    size: [f32; 2],
}

impl All {
    fn of(light: Option<&LightValue>) -> Self {
        let mut all = Self {
            shape: Shape::Point,
            position: Vec3::new(0.0, 2.0, 0.0),
            direction: Vec3::NEG_Y,
            intensity: Vec3::splat(10.0),
            inner: 45f32.to_radians() * 0.85,
            outer: 45f32.to_radians(),
            size: [1.0; 2],
        };
        if let Some(light) = light {
            all.intensity = light.intensity;
            match light.kind {
                LightKind::Point { position } => (all.shape, all.position) = (Shape::Point, position),
                LightKind::Directional { direction } => (all.shape, all.direction) = (Shape::Directional, direction),
                LightKind::Spot { position, direction, inner, outer } => {
                    (all.shape, all.position, all.direction) = (Shape::Spot, position, direction);
                    (all.inner, all.outer) = (inner, outer);
                }
                LightKind::Area { corner, u, v } => {
                    (all.shape, all.position) = (Shape::Area, corner + 0.5 * (u + v));
                    (all.direction, all.size) = (u.cross(v).normalize_or(Vec3::NEG_Y), [u.length(), v.length()]);
                }
            }
        }
        all
    }
}

impl Light {
    fn changed(&self, light: Option<&LightValue>) -> Result<LightValue> {
        let mut all = All::of(light);
        all.shape = self.kind.unwrap_or(all.shape);
        all.position = self.position.map_or(all.position, Vec3::from);
        if let Some(direction) = self.direction {
            all.direction = Vec3::from(direction).try_normalize().ok_or_else(|| {
                Error::compute(format!("direction {direction:?} points nowhere"), "give a direction that is not zero")
            })?;
        }
        if self.colour.is_some() || self.intensity.is_some() {
            // What is given of the two replaces its part: strength is the largest component.
            let strength = all.intensity.max_element();
            // A black light has no colour to keep.
            let kept = if strength > 0.0 { all.intensity / strength } else { Vec3::ONE };
            let colour = self.colour.map_or(kept, Vec3::from);
            all.intensity = colour * self.intensity.unwrap_or(strength);
        }
        if self.cone.is_some() || self.softness.is_some() {
            let softness = self.softness.unwrap_or(1.0 - all.inner / all.outer.max(1e-6));
            all.outer = self.cone.map_or(all.outer, f32::to_radians);
            all.inner = all.outer * (1.0 - softness.clamp(0.0, 1.0));
        }
        all.size = self.size.unwrap_or(all.size);
        let All { position, direction, inner, outer, size, .. } = all;
        let kind = match all.shape {
            Shape::Point => LightKind::Point { position },
            Shape::Spot => LightKind::Spot { position, direction, inner, outer },
            Shape::Directional => LightKind::Directional { direction },
            Shape::Area => {
                let (a, b) = direction.any_orthonormal_pair();
                let (u, v) = (a * size[0], b * size[1]);
                LightKind::Area { corner: position - 0.5 * (u + v), u, v }
            }
        };
        Ok(LightValue { name: self.name.clone(), kind, intensity: all.intensity })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_given_stays() {
        let spot = LightKind::Spot { position: Vec3::ONE, direction: Vec3::X, inner: 0.2, outer: 0.4 };
        let old = LightValue { name: "key".into(), kind: spot, intensity: Vec3::new(2.0, 1.0, 0.5) };
        let same = Light { name: "key".into(), ..Light::default() }.changed(Some(&old)).unwrap();
        assert_eq!(same, old);
        let brighter = Light { intensity: Some(8.0), ..Light::default() }.changed(Some(&old)).unwrap();
        assert_eq!(brighter.intensity, Vec3::new(8.0, 4.0, 2.0));
    }

    #[test]
    fn a_black_light_can_be_turned_up() {
        let point = LightKind::Point { position: Vec3::ONE };
        let black = LightValue { name: "key".into(), kind: point, intensity: Vec3::ZERO };
        let lit = Light { intensity: Some(8.0), ..Light::default() }.changed(Some(&black)).unwrap();
        assert_eq!(lit.intensity, Vec3::splat(8.0));
        let red = Light { colour: Some([1.0, 0.0, 0.0]), ..Light::default() };
        assert_eq!(red.changed(Some(&black)).unwrap().intensity, Vec3::ZERO);
        let red = Light { intensity: Some(2.0), ..red }.changed(Some(&black)).unwrap();
        assert_eq!(red.intensity, Vec3::X * 2.0);
    }

    #[test]
    fn an_area_light_faces_its_direction() {
        let area = Light {
            kind: Some(Shape::Area),
            size: Some([2.0, 3.0]),
            direction: Some([0.0, 0.0, 5.0]),
            ..Light::default()
        };
        let LightKind::Area { u, v, .. } = area.changed(None).unwrap().kind else { panic!("not an area light") };
        assert!((u.cross(v) - Vec3::Z * 6.0).length() < 1e-5);
    }

    #[test]
    fn a_direction_of_zero_is_refused() {
        assert!(Light { direction: Some([0.0; 3]), ..Light::default() }.changed(None).is_err());
    }
}
