//! Kernels on pictures of ratios.

use crate::{ARITHMETIC, Devices, Outcome, Random, UGLY, compare};
use chiaro::device::Array;
use chiaro::kernels::ratio_blur::ratio_blur;
use chiaro::kernels::ratio_warp::{Place, ratio_warp};

const SIZES: [(usize, usize); 6] = [(1, 1), (1, 7), (9, 1), (13, 11), (64, 3), (67, 51)];

/// Ratios, every seventh with something ugly in it; some pixels without a ratio.
fn picture(random: &mut Random, pixels: usize, ugly: bool) -> Vec<[f32; 4]> {
    let mut values = if ugly { random.ugly(pixels, &UGLY) } else { random.light(pixels) };
    values.iter_mut().for_each(|value| value[3] = [1.0, 1.0, 0.5, 0.0][random.below(4)]);
    values
}

pub fn blurs(devices: &Devices) -> Outcome {
    let mut random = Random(31);
    for (width, height) in SIZES {
        let pixels = width * height;
        let words = |random: &mut Random| -> Array<u32> {
            (0..pixels.div_ceil(4)).map(|_| random.below(1 << 32) as u32).collect::<Vec<_>>().into()
        };
        for ugly in [false, true] {
            let values = picture(&mut random, pixels, ugly);
            // Differences of 65504 leave their rounding.
            let tolerance = if ugly { (65504.0 * 1e-6, 1e-5) } else { ARITHMETIC };
            for share in [0.0, 0.2, 0.93] {
                let links = [words(&mut random), words(&mut random)];
                for links in [None, Some(links.each_ref())] {
                    compare(&format!("{width} x {height}, {share}"), devices, tolerance, |device| {
                        ratio_blur(device, &values, width, share, links)
                    })?;
                }
            }
        }
    }
    Ok(())
}

pub fn warps(devices: &Devices) -> Outcome {
    let mut random = Random(32);
    for (width, height) in SIZES {
        for ugly in [false, true] {
            let values = picture(&mut random, width * height, ugly);
            let mut around = |size: usize| (3.0 * random.unit() - 1.0) * size as f32;
            let mut places: Vec<Place> = (0..700)
                .map(|_| Place {
                    at: [around(width), around(height)],
                    counts: [1; 2],
                    sides: [[around(9), around(5)], [around(5), around(9)]],
                })
                .collect();
            for (k, place) in places.iter_mut().enumerate() {
                place.counts = [(k % 7) as u32, (k / 7 % 9) as u32];
                if k % 3 == 0 {
                    place.at = place.at.map(f32::round);
                    place.counts = [1; 2];
                }
            }
            places[5] = Place { at: [2e8, -2e8], counts: [64, 64], sides: [[2e8, 0.0], [0.0, 2e8]] };
            places[6] = Place::NOWHERE;
            // Between 0 and 65504 a rounding of the place is a rounding of 65504.
            let tolerance = if ugly { (65504.0 * 2e-5, 1e-5) } else { (2e-5, 1e-5) };
            compare(&format!("{width} x {height}"), devices, tolerance, |device| {
                let mut warped = vec![[0.0; 4]; places.len()];
                ratio_warp(device, &values, width, &places, &mut warped).map(|()| warped)
            })?;
        }
    }
    Ok(())
}
