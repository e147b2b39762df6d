//! Masks of visibility: both bodies draw the same, but for texels next to edges.

use super::*;
use chiaro::kernels::visibility_masks;
use chiaro::scene::bvh::Ray;
use chiaro::scene::{Occluders, cube};

pub fn masks(devices: &Devices) -> Outcome {
    let nowhere = SurfacePoint::NOWHERE;
    for (name, (width, height), size) in [("room", (11, 9), 64), ("hall", (7, 5), 128)] {
        let scene = builtin::scene(name).expect("it ships in the program");
        let camera = &scene.cameras[0];
        let mut points =
            primary_visibility(&Device::Cpu, &scene.geometry, camera, (width, height), &[[0.5; 2]]).unwrap().points;
        points.insert(3, nowhere);
        let all = Occluders::new(&scene.geometry, |_| true);
        let some = Occluders::new(&scene.geometry, |object| object % 2 == 1);
        let none = Occluders::new(&scene.geometry, |_| false);
        let wanted: Vec<u32> = (0..size * size / 32).map(|word| sampling::hash(word as u32)).collect();
        for (face, occluders, wanted) in [
            (0, &all, None),
            (1, &some, None),
            (2, &all, Some(&wanted[..])),
            (3, &all, None),
            (4, &none, None),
            (5, &all, None),
        ] {
            let run = |device| {
                visibility_masks(device, occluders, &points, face, size, wanted).map_err(|error| error.to_string())
            };
            let cpu = run(&Device::Cpu)?;
            // Of what is seen, nothing faces away from the camera: two faces may be closed.
            if ![3, 5].contains(&face) && cpu.iter().all(|&word| word == 0) {
                return Err(format!("{name}, face {face}: nothing is open, so nothing was compared"));
            }
            for device in [&devices.gpu, &devices.paged] {
                let differ = differing(occluders, &points, face, size, &run(device)?, &cpu)?;
                eprintln!("{name}, face {face}: {differ} of {} texels differ", 32 * cpu.len());
                if differ * 10_000 > 32 * cpu.len() {
                    return Err(format!("{name}, face {face}: {differ} of {} texels differ", 32 * cpu.len()));
                }
            }
            let mut spoilt = cpu.clone();
            let middle = (size / 2 + 3) * size / 32;
            spoilt.iter_mut().skip(middle).step_by(size * size / 32).for_each(|word| *word ^= 0x0080_0000);
            if differing(occluders, &points, face, size, &spoilt, &cpu).is_ok() {
                return Err(format!("{name}, face {face}: a wrong texel of every sample passed"));
            }
        }
    }
    Ok(())
}

/// How many texels differ; an error when one of them is not next to an edge: when rays within a 250th of a texel all tell
/// the same.
fn differing(
    occluders: &Occluders,
    points: &[SurfacePoint],
    face: usize,
    size: usize,
    gpu: &[u32],
    cpu: &[u32],
) -> Result<usize, String> {
    if gpu.len() != cpu.len() {
        return Err(format!("{} words, CPU {}", gpu.len(), cpu.len()));
    }
    let mut differ = 0;
    let axis = cube::axis(face).0;
    for (i, (gpu, cpu)) in gpu.iter().zip(cpu).enumerate() {
        let point = &points[i / (size * size / 32)];
        for bit in (0..32).filter(|bit| (gpu ^ cpu) >> bit & 1 == 1) {
            let texel = 32 * i % (size * size) + bit;
            let direction = cube::texel_point(face * size * size + texel, size);
            let origin = sampling::lifted(point.position.into(), point.geometric_normal.into(), occluders.lift);
            let open = (0..9).filter(|k| {
                let mut direction = direction;
                direction[(axis + 1) % 3] += 0.008 / size as f32 * (k % 3 - 1) as f32;
                direction[(axis + 2) % 3] += 0.008 / size as f32 * (k / 3 - 1) as f32;
                let ray = Ray { origin, direction, t_max: f32::INFINITY };
                Vec3::from(point.normal).dot(direction) > 0.0 && !occluders.bvh.any(&ray)
            });
            if !point.exists() || [0, 9].contains(&open.count()) {
                return Err(format!("texel {texel} of face {face} at {:?} is far from any edge", point.position));
            }
            differ += 1;
        }
    }
    Ok(differ)
}
