//! Lights that are not surfaces, and rectangles that emit. Radiometric units: W/sr for point and spot, W/m² for
//! directional (irradiance on a facing surface), W/(sr m²) for area.

use glam::Vec3;

#[derive(Clone, Debug, PartialEq)]
pub enum LightKind {
    Point {
        position: Vec3,
    },
    /// Full strength inside `inner`, none outside `outer` (half angles, radians).
    Spot {
        position: Vec3,
        direction: Vec3,
        inner: f32,
        outer: f32,
    },
    /// Light travels along `direction`.
    Directional {
        direction: Vec3,
    },
    /// A rectangle with corner `corner` and edges `u`, `v`; emits from the side that `u x v` points to. It is not
    /// seen by cameras and casts no shadow.
    Area {
        corner: Vec3,
        u: Vec3,
        v: Vec3,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    pub name: String,
    pub kind: LightKind,
    /// Linear Rec.709 colour times intensity, in the unit of the kind.
    pub intensity: Vec3,
}
