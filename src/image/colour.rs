//! Colour edits as linear 3x3 matrices on Rec.709 primaries, and the transfer curve of sRGB.
//!
//! Matrices, because an edit of light must be linear: the sum of edited lights is the edit of their sum. Both keep
//! grey grey and keep luminance. Saturated colours may turn negative (out of gamut); nothing is clipped here.

use glam::{Mat3, Vec3};

/// Rec.709 luminance weights of red, green and blue; they add up to 1 (ITU-R BT.709-6, 3.2).
pub const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

pub fn luminance(rgb: Vec3) -> f32 {
    LUMINANCE.dot(rgb)
}

/// The matrix that puts `row . c` into all three channels.
fn grey_of(row: Vec3) -> Mat3 {
    Mat3::from_cols(Vec3::splat(row.x), Vec3::splat(row.y), Vec3::splat(row.z))
}

/// `c -> Y + s (c - Y)`: 0 is grey, 1 leaves colours as they are, above 1 strengthens them. Keeps luminance.
pub fn saturation(s: f32) -> Mat3 {
    if s == 1.0 {
        return Mat3::IDENTITY;
    }
    Mat3::IDENTITY * s + grey_of(LUMINANCE * (1.0 - s))
}

/// Turns hues about the grey axis; 120 degrees takes red's hue to green's, green's to blue's.
///
/// The rotation `R` about (1, 1, 1), then a shift along grey that gives each colour its luminance back:
/// `M = R + 1 (w' - w' R)`. So `hue(a) hue(b) = hue(a + b)`.
pub fn hue(degrees: f32) -> Mat3 {
    if degrees % 360.0 == 0.0 {
        return Mat3::IDENTITY;
    }
    let rotation = Mat3::from_axis_angle(Vec3::ONE.normalize(), degrees.to_radians());
    rotation + grey_of(LUMINANCE - rotation.transpose() * LUMINANCE)
}

/// Linear light of an sRGB-encoded value, 0 to 1 (IEC 61966-2-1).
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB encoding of linear light, 0 to 1 (IEC 61966-2-1).
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Vec3, b: Vec3, limit: f32) {
        assert!((a - b).abs().max_element() <= limit, "{a} is not {b}");
    }

    #[test]
    fn grey_and_luminance_stay() {
        let colour = Vec3::new(0.8, 0.1, 0.3);
        for matrix in [saturation(0.0), saturation(2.5), hue(37.0), hue(-120.0)] {
            close(matrix * Vec3::splat(0.4), Vec3::splat(0.4), 1e-6);
            assert!((luminance(matrix * colour) - luminance(colour)).abs() < 1e-6);
        }
    }

    #[test]
    fn saturation_by_hand() {
        close(saturation(0.0) * Vec3::X, Vec3::splat(0.2126), 1e-7);
        // Y = 0.2126; 0.2126 + 0.5 * (1 - 0.2126) = 0.6063, 0.2126 - 0.5 * 0.2126 = 0.1063
        close(saturation(0.5) * Vec3::X, Vec3::new(0.6063, 0.1063, 0.1063), 1e-6);
        assert_eq!(saturation(1.0), Mat3::IDENTITY);
    }

    #[test]
    fn hue_by_hand() {
        // 120 degrees permute the channels; green's luminance is 0.7152, so red loses 0.5026 along grey.
        close(hue(120.0) * Vec3::X, Vec3::new(-0.5026, 0.4974, -0.5026), 1e-6);
        close((hue(25.0) * hue(50.0)) * Vec3::X, hue(75.0) * Vec3::X, 1e-6);
        assert_eq!(hue(0.0), Mat3::IDENTITY);
        assert_eq!(hue(-720.0), Mat3::IDENTITY);
    }

    #[test]
    fn srgb_there_and_back() {
        assert!((linear_from_srgb(0.5) - 0.214_041).abs() < 1e-6);
        for code in 0..=255u8 {
            let back = srgb_from_linear(linear_from_srgb(f32::from(code) / 255.0)) * 255.0;
            assert_eq!(back.round() as u8, code);
        }
    }
}
