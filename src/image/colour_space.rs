//! The linear colour spaces that pictures come in, and the way from one to another.
//!
//! Names are the ids of the Color Interop Forum, as OpenEXR headers carry them in `colorInteropID`. White points are
//! adapted by Bradford's matrix (ICC.1:2022, annex E), so white stays white.

use exr::meta::attribute::Chromaticities;
use exr::prelude::Vec2;
use glam::{DMat3, DVec2, DVec3, Mat3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What red, green and blue of 1 stand for. All are linear in light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum ColourSpace {
    /// Rec.709 and sRGB primaries, white D65.
    #[default]
    #[serde(rename = "lin_rec709_scene")]
    Rec709,
    /// ACEScg: AP1 primaries, ACES white.
    #[serde(rename = "lin_ap1_scene")]
    AcesCg,
    /// ACES2065-1: AP0 primaries, ACES white.
    #[serde(rename = "lin_ap0_scene")]
    Aces,
    /// Rec.2020 primaries, white D65.
    #[serde(rename = "lin_rec2020_scene")]
    Rec2020,
    /// P3 primaries, white D65.
    #[serde(rename = "lin_p3d65_scene")]
    P3,
}

/// CIE xy.
const D65: [f64; 2] = [0.3127, 0.3290];
const ACES_WHITE: [f64; 2] = [0.32168, 0.33767];

impl ColourSpace {
    pub const ALL: [Self; 5] = [Self::Rec709, Self::AcesCg, Self::Aces, Self::Rec2020, Self::P3];

    /// As files and recipes name it.
    pub fn id(self) -> &'static str {
        match self {
            Self::Rec709 => "lin_rec709_scene",
            Self::AcesCg => "lin_ap1_scene",
            Self::Aces => "lin_ap0_scene",
            Self::Rec2020 => "lin_rec2020_scene",
            Self::P3 => "lin_p3d65_scene",
        }
    }

    pub fn of_id(id: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|space| space.id() == id)
    }

    /// CIE xy of red, green, blue and white.
    fn primaries(self) -> [[f64; 2]; 4] {
        match self {
            Self::Rec709 => [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65],
            Self::AcesCg => [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], ACES_WHITE],
            Self::Aces => [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770], ACES_WHITE],
            Self::Rec2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65],
            Self::P3 => [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65],
        }
    }

    pub fn chromaticities(self) -> Chromaticities {
        let [red, green, blue, white] = self.primaries().map(|[x, y]| Vec2(x as f32, y as f32));
        Chromaticities { red, green, blue, white }
    }

    /// The space with these primaries; `None` for one that has no name here.
    pub fn of_chromaticities(found: &Chromaticities) -> Option<Self> {
        let found = [found.red, found.green, found.blue, found.white];
        let near = |a: &[f64; 2], b: &Vec2<f32>| DVec2::from(*a).distance(DVec2::new(b.0.into(), b.1.into())) < 1e-3;
        Self::ALL.into_iter().find(|space| space.primaries().iter().zip(&found).all(|(a, b)| near(a, b)))
    }

    /// Takes colours of this space to the same colours in another.
    pub fn to(self, other: Self) -> Mat3 {
        if self == other {
            return Mat3::IDENTITY;
        }
        let (from, to) = (self.primaries(), other.primaries());
        (xyz(to).inverse() * adaptation(from[3], to[3]) * xyz(from)).as_mat3()
    }
}

/// XYZ of luminance 1.
fn white_xyz([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// RGB to XYZ, so that white is (1, 1, 1) (SMPTE RP 177).
fn xyz([red, green, blue, white]: [[f64; 2]; 4]) -> DMat3 {
    let column = |[x, y]: [f64; 2]| DVec3::new(x, y, 1.0 - x - y);
    let primaries = DMat3::from_cols(column(red), column(green), column(blue));
    let scale = primaries.inverse() * white_xyz(white);
    primaries * DMat3::from_diagonal(scale)
}

fn adaptation(from: [f64; 2], to: [f64; 2]) -> DMat3 {
    if from == to {
        return DMat3::IDENTITY;
    }
    let cones = DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296]);
    let scale = (cones * white_xyz(to)) / (cones * white_xyz(from));
    cones.inverse() * DMat3::from_diagonal(scale) * cones
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn matrices_are_the_published_ones() {
        let near = |a: Vec3, b: [f32; 3]| assert!((a - Vec3::from(b)).abs().max_element() < 2e-4, "{a} is not {b:?}");
        // The columns of ACES 1's AP1 to Rec.709 matrix with Bradford's adaptation.
        let matrix = ColourSpace::AcesCg.to(ColourSpace::Rec709);
        near(matrix.x_axis, [1.70505, -0.13026, -0.02400]);
        near(matrix.y_axis, [-0.62179, 1.14080, -0.12897]);
        near(matrix.z_axis, [-0.08326, -0.01055, 1.15297]);
        // ITU-R BT.2087, Rec.709 to Rec.2020.
        let matrix = ColourSpace::Rec709.to(ColourSpace::Rec2020);
        near(matrix.x_axis, [0.6274, 0.0691, 0.0164]);
        near(matrix.z_axis, [0.0433, 0.0114, 0.8956]);
    }

    #[test]
    fn white_stays_white_and_the_way_back_is_the_way_back() {
        for a in ColourSpace::ALL {
            assert_eq!(ColourSpace::of_id(a.id()), Some(a));
            assert_eq!(ColourSpace::of_chromaticities(&a.chromaticities()), Some(a));
            assert_eq!(serde_json::to_value(a).unwrap(), a.id());
            for b in ColourSpace::ALL {
                assert!((a.to(b) * Vec3::ONE - Vec3::ONE).abs().max_element() < 1e-5, "{a:?} {b:?}");
                assert!((b.to(a) * a.to(b)).abs_diff_eq(Mat3::IDENTITY, 1e-5), "{a:?} {b:?}");
            }
        }
        let odd = Chromaticities { red: Vec2(0.6, 0.4), ..ColourSpace::P3.chromaticities() };
        assert_eq!(ColourSpace::of_chromaticities(&odd), None);
    }
}
