//! Surface points as points in six dimensions, for k-d trees that look for places near by that are turned alike.

use glam::Vec3;

/// Position (from `centre`) and normal in one space: turning by 90 degrees is as far as 1.4 times `normal_scale`.
pub fn feature(position: Vec3, normal: Vec3, centre: Vec3, normal_scale: f32) -> [f32; 6] {
    let p = position - centre;
    let n = normal * normal_scale;
    mixed([p.x, p.y, p.z, n.x, n.y, n.z])
}

/// The axes mixed by a conference matrix of order 6 (Belevitch 1950): all distances grow by sqrt(5), so that neighbours
/// stay neighbours. On flat surfaces four axes of a feature are constant, which a k-d tree splits along in vain; mixed,
/// every axis tells points of a plane apart, in directions that differ.
fn mixed(f: [f32; 6]) -> [f32; 6] {
    let [a, b, c, d, e, f] = f;
    [b + c + d + e + f, a + c - d - e + f, a + b + d - e - f, a - b + c + e - f, a - b - c + d + f, a + b - c - d + e]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling;

    #[test]
    fn mixing_axes_keeps_the_order_of_distances() {
        let squared = |f: [f32; 6]| f.iter().map(|x| x * x).sum::<f32>();
        for i in 0..100 {
            let f = std::array::from_fn(|axis| 2.0 * sampling::unit(sampling::hash(6 * i + axis as u32)) - 1.0);
            assert!((squared(mixed(f)) - 5.0 * squared(f)).abs() < 1e-5 * squared(f), "{f:?}");
        }
    }
}
