//! Light of an irradiance cache: both bodies find the same records, and make the same light of them.

use super::rays::{room, seen};
use super::*;
use chiaro::kernels::cached_light;
use chiaro::transport::final_gather::cache::{Cache, Fresh, Record};
use chiaro::transport::light_cache::{Gradients, Parting};
use glam::Vec4;

/// A weight as selections have them: none, whole, or some.
fn weight(random: &mut Random) -> f32 {
    [0.0, 1.0, 1.0, 1.0, 0.7 + 0.3 * random.unit()][random.below(5)]
}

/// Records at points, of all sizes from about a pixel on.
fn cache(points: &[SurfacePoint], parting: Parting, random: &mut Random) -> Cache {
    let mut any = |scale: f32| Vec4::from_array(random.light(1)[0].map(|x| scale * (x - 1.0)));
    let mut fresh = Fresh::default();
    for _ in points {
        let mut each = |scale| [any(scale), any(scale), any(scale)];
        let (moved, turned) = (each(0.5), each(0.5));
        fresh.light.push(Gradients { value: any(1.0).abs(), moved, turned });
        fresh.changes.extend((0..parting.count).map(|_| any(1.0)));
    }
    for &place in points {
        let radius = 2.0 * 10f32.powf(-3.0 * random.unit());
        fresh.receivers.extend((0..parting.count).map(|_| weight(random)));
        let bend = 1.0 + 3.0 * random.unit();
        fresh.records.push(Record { place, seed: 0, radius, bend, footprint: 0.03, rays: 64, variance: 0.1 });
    }
    let mut cache = Cache::new(0.5, 1.0, parting);
    cache.extend(fresh, false);
    cache.refresh();
    cache
}

pub fn cached(devices: &Devices) -> Outcome {
    let scene = room();
    let mut places = seen(&scene, 71, 53).to_vec();
    places.retain(SurfacePoint::exists);
    let mut points = seen(&scene, 96, 71).to_vec();
    points.splice(9..9, places[..50].iter().copied().chain([SurfacePoint::NOWHERE]));
    points.push(SurfacePoint { position: [f32::NAN; 3], ..points[0] });
    points.push(SurfacePoint { position: [65504.0, -65504.0, 0.0], ..points[0] });
    let mut random = Random(11);
    for (count, by_material, records) in
        [(0, false, places.len()), (2, false, places.len()), (3, true, 300), (1, true, 1), (0, false, 0)]
    {
        let cache = cache(&places[..records], Parting { count, by_material }, &mut random);
        let weights: Vec<f32> = (0..points.len() * count).map(|_| weight(&mut random)).collect();
        let run = |device: &Device, cache: &Cache| {
            cached_light(device, &cache.columns, &points, &weights).map_err(|error| error.to_string())
        };
        let cpu = run(&Device::Cpu, &cache)?;
        let known = cpu.iter().filter(|found| found[3] > 0.0).count();
        eprintln!("{records} records, {count} receivers: {known} of {} places are known", points.len());
        if records == places.len() && known * 4 < points.len() || known == points.len() {
            return Err(format!("{records} records: {known} places are known, so little was compared"));
        }
        for device in [&devices.gpu, &devices.paged] {
            nearly_all("places", &run(device, &cache)?, &cpu, |a, b| close(a, b))?;
        }
        for spoil in SPOILS.iter().filter(|_| records == places.len() && count > 0) {
            let mut spoilt = cache.clone();
            spoil(&mut spoilt);
            let spoilt = run(&devices.gpu, &spoilt)?;
            if nearly_all("places", &spoilt, &cpu, |a, b| close(a, b)).is_ok() {
                return Err("a cache that was spoilt passed".to_owned());
            }
        }
    }
    Ok(())
}

/// Negative controls: what a shader that overlooks a part of the cache would find.
const SPOILS: &[fn(&mut Cache)] = &[
    |cache| cache.columns.error *= 0.99,
    |cache| cache.columns.index.records.rotate_left(1),
    |cache| cache.columns.receivers.fill(1.0),
    |cache| cache.columns.changes.fill(Vec4::ZERO),
    |cache| cache.columns.light.iter_mut().for_each(|light| light.moved = [Vec4::ZERO; 3]),
    |cache| cache.columns.light.iter_mut().for_each(|light| light.turned = [Vec4::ZERO; 3]),
    |cache| cache.columns.shapes.iter_mut().for_each(|shape| shape.damping = 1.0),
];
