//! Kernels that shoot rays, in the built-in room.

use super::*;

pub fn room() -> Scene {
    builtin::scene("room").expect("it ships in the program")
}

/// What the room's camera sees, on the CPU.
pub fn seen(scene: &Scene, width: u32, height: u32) -> Array<SurfacePoint> {
    let visible =
        primary_visibility(&Device::Cpu, &scene.geometry, &scene.cameras[0], (width, height), &[[0.5; 2]]).unwrap();
    visible.points.into()
}

fn live(geometry: &Geometry, points: &[SurfacePoint]) -> Vec<u8> {
    sides::live_sides(geometry, points, &NoMemo).unwrap()
}

fn same_point(a: &SurfacePoint, b: &SurfacePoint) -> bool {
    (a.object, a.material, a.triangle) == (b.object, b.material, b.triangle)
        && close(&a.position, &b.position)
        && close(&a.normal, &b.normal)
        && close(&a.geometric_normal, &b.geometric_normal)
}

pub fn views(devices: &Devices) -> Outcome {
    let scene = room();
    let outside = Camera::look_at("outside", Vec3::new(9.0, 7.0, 11.0), Vec3::ZERO, 0.7);
    let four = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];
    for (camera, size, offsets) in [
        (&scene.cameras[0], (1, 1), &[[0.5; 2]][..]),
        (&scene.cameras[0], (203, 151), &[[0.5; 2]]),
        (&outside, (97, 65), &four),
    ] {
        let run = |device| {
            primary_visibility(device, &scene.geometry, camera, size, offsets).map_err(|error| error.to_string())
        };
        let cpu = run(&Device::Cpu)?;
        if cpu.points.iter().all(|point| !point.exists()) {
            return Err("the camera sees nothing, so nothing was compared".to_owned());
        }
        for device in [&devices.gpu, &devices.paged] {
            let gpu = run(device)?;
            nearly_all("points", &gpu.points, &cpu.points, same_point)?;
            nearly_all("barycentrics", &gpu.barycentrics, &cpu.barycentrics, |a, b| close(a, b))?;
        }
    }
    Ok(())
}

/// Rays of any kind: from inside and outside, between limits, without length, not finite.
fn any_rays(count: u32) -> Vec<RayRecord> {
    let random = |i: u32| 2.0 * sampling::unit(sampling::hash(i)) - 1.0;
    let ray = |i: u32| {
        let at = |k: u32| Vec3::new(random(9 * i + k), random(9 * i + k + 1), random(9 * i + k + 2));
        let (origin, direction) = (at(0) * 2.5 + Vec3::Y, at(3));
        let limits = [(0.0, 3e38), (0.5, 3e38), (0.0, 1.5), (1.0, 2.0), (0.0, 0.0)][i as usize % 5];
        RayRecord { origin: origin.to_array(), t_max: limits.1, direction: direction.to_array(), t_min: limits.0 }
    };
    let ugly = [[0.0; 3], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [0.0, -0.0, 1e-30], [65504.0, 0.0, 0.0]];
    let ugly = ugly.map(|direction| RayRecord { origin: [0.1, 1.0, 0.2], t_max: 3e38, direction, t_min: 0.0 });
    (0..count).map(ray).chain(ugly).collect()
}

pub fn traced(devices: &Devices) -> Outcome {
    let scene = room();
    for count in [0, 1, 4099] {
        let rays = any_rays(count);
        let run = |device| trace_rays(device, &scene.geometry, &rays).map_err(|error| error.to_string());
        let cpu = run(&Device::Cpu)?;
        if count > 1 && !cpu.points.iter().any(|point| point.exists()) {
            return Err("no ray met anything, so nothing was compared".to_owned());
        }
        for device in [&devices.gpu, &devices.paged] {
            let gpu = run(device)?;
            nearly_all("points", &gpu.points, &cpu.points, same_point)?;
            nearly_all("barycentrics", &gpu.barycentrics, &cpu.barycentrics, |a, b| close(a, b))?;
            nearly_all("distances", &gpu.distances, &cpu.distances, |a, b| close(&[*a], &[*b]))?;
        }
    }
    Ok(())
}

pub fn blocked(devices: &Devices) -> Outcome {
    let scene = room();
    for count in [0, 1, 4099] {
        let rays = any_rays(count);
        let run = |device| blocked_rays(device, &scene.geometry, &rays).map_err(|error| error.to_string());
        let cpu = run(&Device::Cpu)?;
        if count > 1 && !(cpu.contains(&0) && cpu.contains(&1)) {
            return Err("all rays end alike, so nothing was compared".to_owned());
        }
        for device in [&devices.gpu, &devices.paged] {
            nearly_all("blocked", &run(device)?, &cpu, |a, b| a == b)?;
        }
    }
    Ok(())
}

pub fn lights(devices: &Devices) -> Outcome {
    let scene = room();
    let points = seen(&scene, 83, 61);
    let mut sources: Vec<_> = scene.lights.iter().map(|light| light.source()).collect();
    sources.extend(light::surfaces(&scene.geometry, &scene.materials));
    for kind in [
        LightKind::Point { position: Vec3::new(0.3, 2.0, 0.4) },
        LightKind::Directional { direction: Vec3::new(0.3, -0.8, -0.5).normalize() },
        LightKind::Spot { position: Vec3::new(0.0, 2.5, 1.0), direction: Vec3::NEG_Y, inner: 0.2, outer: 0.6 },
        LightKind::Area { corner: Vec3::new(-0.5, 2.5, -0.5), u: Vec3::X, v: Vec3::Z },
    ] {
        sources.push(Light { name: "added".to_owned(), kind, intensity: Vec3::new(3.0, 2.0, 1.0) }.source());
    }
    // Not below 0.3: a sharper lobe multiplies the rounding of the half vector by thousands.
    let gloss: Vec<[f32; 4]> = (0..scene.materials.len()).map(|i| [0.04, 0.1, 0.5, 0.3 + 0.08 * i as f32]).collect();
    let gloss = Array::from(gloss);
    let view = View { eye: scene.cameras[0].position, gloss: &gloss };
    for source in sources {
        let emitters = Array::from(source.emitters.clone());
        for view in [None, Some(&view)] {
            let run = |device| {
                direct_light(device, &scene.geometry, &points, &source.record, &emitters, 9, view)
                    .map_err(|error| error.to_string())
            };
            let cpu = run(&Device::Cpu)?;
            if cpu.irradiance.iter().flatten().all(|&x| x == 0.0) {
                return Err(format!("light \"{}\" lights nothing, so nothing was compared", source.name));
            }
            for device in [&devices.gpu, &devices.paged] {
                let gpu = run(device)?;
                let named = |what: String| format!("{}: {what}", source.name);
                nearly_all("irradiances", &gpu.irradiance, &cpu.irradiance, |a, b| close(a, b)).map_err(named)?;
                nearly_all("highlights", &gpu.highlight, &cpu.highlight, |a, b| close(a, b)).map_err(named)?;
            }
        }
    }
    Ok(())
}

pub fn pairs(devices: &Devices) -> Outcome {
    let scene = room();
    let points = seen(&scene, 13, 11);
    let gather =
        Gather::place(&scene.geometry, &live(&scene.geometry, &points), 1 << 10).map_err(|error| error.to_string())?;
    let run = |device| transfer_points(device, &scene.geometry, &gather, &points).map_err(|error| error.to_string());
    let cpu = run(&Device::Cpu)?;
    if cpu.weights.iter().all(|&weight| weight == 0.0) {
        return Err("no sample is seen, so nothing was compared".to_owned());
    }
    for device in [&devices.gpu, &devices.paged] {
        let wide = |weights: &[f32]| weights.iter().map(|&w| [w; 4]).collect::<Vec<_>>();
        nearly_all("weights", &wide(&run(device)?.weights), &wide(&cpu.weights), |a, b| close(a, b))?;
    }
    Ok(())
}

pub fn rows(devices: &Devices) -> Outcome {
    let scene = room();
    let points = seen(&scene, 29, 23);
    let gather =
        Gather::place(&scene.geometry, &live(&scene.geometry, &points), 1 << 10).map_err(|error| error.to_string())?;
    let seeds: Array<u32> = (0..points.len() as u32).map(sampling::hash).collect::<Vec<_>>().into();
    let starts = Starts { points: &points, seeds: &seeds, before: None };
    for (rays, credit) in [(1, 0.25), (64, 0.25), (100, 0.0), (257, 4.0)] {
        let run = |device| {
            transfer_rows(device, &scene.geometry, &gather, &starts, rays, credit).map_err(|error| error.to_string())
        };
        let cpu = run(&Device::Cpu)?;
        if cpu.nodes.iter().all(|&node| node == 0) {
            return Err("no ray was credited, so nothing was compared".to_owned());
        }
        for device in [&devices.gpu, &devices.paged] {
            let gpu = run(device)?;
            nearly_all("nodes", &gpu.nodes, &cpu.nodes, |a, b| a == b)
                .map_err(|what| format!("{rays} rays: {what}"))?;
            // A row's least distance comes from one ray of many, so a few rows may differ.
            let share = gpu.distances.iter().zip(&cpu.distances).filter(|(a, b)| close(&a[..], &b[..])).count() as f32
                / cpu.distances.len() as f32;
            if gpu.distances.len() != cpu.distances.len() || share < 0.98 {
                return Err(format!("{rays} rays: {share} of the distances agree"));
            }
        }
    }
    Ok(())
}

pub fn behind(devices: &Devices) -> Outcome {
    let scene = room();
    let points = seen(&scene, 29, 23);
    let gather =
        Gather::place(&scene.geometry, &live(&scene.geometry, &points), 1 << 10).map_err(|error| error.to_string())?;
    let seeds: Array<u32> = (0..points.len() as u32).map(sampling::hash).collect::<Vec<_>>().into();
    let some: Array<u32> = (0..2 * gather.count() as u32).map(|node| node % 3).collect::<Vec<_>>().into();
    let all: Array<u32> = vec![1; 2 * gather.count()].into();
    for (rays, credit, layers, admitted) in [(1, 0.25, 4, &all), (64, 0.25, 4, &some), (100, 0.0, 1, &all)] {
        let run = |device| {
            let walk = Walk { rays, credit, layers };
            hidden_rows(device, &scene.geometry, &gather, &points, &seeds, admitted, walk)
                .map_err(|error| error.to_string())
        };
        let cpu = run(&Device::Cpu)?;
        if cpu.nodes.iter().all(|&node| node == 0) || layers == 1 && cpu.dropped.iter().all(|&dropped| dropped == 0) {
            return Err(format!("{rays} rays: nothing is hidden, or nothing left out, so nothing was compared"));
        }
        for device in [&devices.gpu, &devices.paged] {
            let gpu = run(device)?;
            nearly_all("nodes", &gpu.nodes, &cpu.nodes, |a, b| a == b)
                .map_err(|what| format!("{rays} rays: {what}"))?;
            // A row's count is of all its rays: one that passes an edge on the other side changes it.
            let equal = gpu.dropped.iter().zip(&cpu.dropped).filter(|(a, b)| a == b).count();
            if gpu.dropped.len() != cpu.dropped.len() || (equal as f32) < 0.95 * cpu.dropped.len() as f32 {
                return Err(format!("{rays} rays: {equal} of {} counts agree", cpu.dropped.len()));
            }
        }
    }
    Ok(())
}

pub fn gloss(devices: &Devices) -> Outcome {
    let scene = room();
    let points = seen(&scene, 29, 23);
    let gather =
        Gather::place(&scene.geometry, &live(&scene.geometry, &points), 1 << 10).map_err(|error| error.to_string())?;
    let seeds: Array<u32> = (0..points.len() as u32).map(sampling::hash).collect::<Vec<_>>().into();
    let lobes = [(0.1, 64, 0.25), (0.3, 100, 0.0), (1.0, 257, 4.0), (0.6, 1, 0.25)];
    for ((alpha, rays, credit), blinn) in lobes.into_iter().flat_map(|lobe| [(lobe, false), (lobe, true)]) {
        let lobe = Lobe { eye: scene.cameras[0].position, alpha, blinn, rays, credit };
        let run = |device| {
            glossy_rows(device, &scene.geometry, &gather, &points, &seeds, &lobe).map_err(|error| error.to_string())
        };
        let cpu = run(&Device::Cpu)?;
        if cpu.shares.iter().all(|share| share.node == 0 || share.weight == 0.0 || share.fresnel == 0.0) {
            return Err("no ray was credited, so nothing was compared".to_owned());
        }
        for device in [&devices.gpu, &devices.paged] {
            let gpu = run(device)?;
            let named = |what: String| format!("{lobe:?}: {what}");
            nearly_all("nodes", &gpu.shares, &cpu.shares, |a, b| a.node == b.node).map_err(named)?;
            nearly_all("weights", &gpu.shares, &cpu.shares, |a, b| {
                a.node == 0 || b.node == 0 || close(&[a.weight, a.fresnel], &[b.weight, b.fresnel])
            })
            .map_err(named)?;
            // A row's least distance comes from one ray of many, so a few rows may differ.
            let share = gpu.distances.iter().zip(&cpu.distances).filter(|(a, b)| close(&a[..], &b[..])).count() as f32
                / cpu.distances.len() as f32;
            if gpu.distances.len() != cpu.distances.len() || share < 0.98 {
                return Err(named(format!("{share} of the distances agree")));
            }
        }
    }
    Ok(())
}

pub fn openness(devices: &Devices) -> Outcome {
    let scene = room();
    let mut points = seen(&scene, 37, 29).to_vec();
    points.push(SurfacePoint::NOWHERE);
    // Outside, where nothing is met, and close to a wall, where hits are near.
    points.push(SurfacePoint {
        position: [50.0, 0.0, 0.0],
        normal: [1.0, 0.0, 0.0],
        geometric_normal: [1.0, 0.0, 0.0],
        ..points[0]
    });
    points.push(SurfacePoint {
        position: [-1.999, 0.0, 0.0],
        normal: [0.0, 1.0, 0.0],
        geometric_normal: [0.0, 1.0, 0.0],
        ..points[0]
    });
    for rays in [1, 64, 100, 257] {
        let run = |device| surroundings(device, &scene.geometry, &points, rays).map_err(|error| error.to_string());
        let cpu = run(&Device::Cpu)?;
        let (finite, infinite) = (cpu.iter().filter(|x| x.is_finite()).count(), cpu.len() - 3);
        if cpu[infinite..infinite + 2] != [f32::INFINITY; 2] || 2 * finite < cpu.len() {
            return Err(format!("{rays} rays: {finite} of {} distances are finite", cpu.len()));
        }
        for device in [&devices.gpu, &devices.paged] {
            let gpu = run(device)?;
            // A mean comes from many rays, one of which may pass an edge on its other side.
            let share = gpu.iter().zip(&cpu).filter(|(a, b)| close(&[**a], &[**b])).count() as f32 / cpu.len() as f32;
            if gpu.len() != cpu.len() || share < 0.98 {
                return Err(format!("{rays} rays: {share} of the distances agree"));
            }
        }
    }
    Ok(())
}
