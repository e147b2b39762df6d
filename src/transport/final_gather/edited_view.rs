//! The view samples of sampled edits, as a renderer asks for them: which are near a place, and how much is edited there.

use crate::scene::{Camera, Geometry, SurfacePoint};
use crate::transport::keyframes::reproject::{ALIKE, Carried, Found, Reach, barycentric};
use crate::transport::sampled::{NOWHERE, Sampled, UNTOUCHED};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::sync::OnceLock;

pub struct EditedView<'a> {
    geometry: &'a Geometry,
    sampled: &'a Sampled,
    camera: Camera,
    /// Samples across and down.
    grid: (usize, usize),
    /// For what the view did not see.
    carried: OnceLock<Carried>,
    /// Of each object, whether some of it is touched.
    touches: Vec<bool>,
    /// Of each sample: what its rows count together.
    amounts: Vec<f32>,
    /// Of each sample of objects that are touched: where all those around it are of its surface and count as much as it
    /// does, the largest distance to one, squared, m²; 0 elsewhere.
    even: Vec<f32>,
}

impl<'a> EditedView<'a> {
    /// `sampled`: of this scene.
    pub fn new(geometry: &'a Geometry, sampled: &'a Sampled) -> Self {
        let (origin, view) = (&sampled.origin, &sampled.view);
        let camera = Camera {
            name: origin.camera.name.clone(),
            position: origin.camera.position,
            world_from_camera: origin.camera.world_from_camera,
            fov_y: origin.camera.fov_y,
        };
        let mut touches = vec![false; geometry.objects.len()];
        let mut amounts = vec![0.0; view.side.len()];
        for ((sample, slots), weights) in sampled.touched.iter().zip(&sampled.slots[..]).zip(&sampled.weights[..]) {
            let slots = slots.iter().zip(weights).filter(|slot| *slot.0 != UNTOUCHED);
            amounts[*sample as usize] = rounded(slots.map(|slot| slot.1).sum());
            let side = view.side[*sample as usize];
            if side != NOWHERE {
                touches[geometry.object[(side / 2) as usize] as usize] = true;
            }
        }
        let grid = (origin.width * origin.across, origin.height * origin.down);
        let even = vec![0.0; amounts.len()];
        let mut new = Self { geometry, sampled, camera, grid, carried: OnceLock::new(), touches, amounts, even };
        let row = |y: usize| (0..grid.0).map(|x| (new.number(x, y), new.evenness(x, y))).collect::<Vec<_>>();
        let even: Vec<_> = (0..grid.1).into_par_iter().map(row).collect();
        even.into_iter().flatten().for_each(|(sample, evenness)| new.even[sample] = evenness);
        new
    }

    pub fn touches(&self, object: u32) -> bool {
        self.touches[object as usize]
    }

    /// How much of the edits there is at a place: the weights of all rows of the samples near it, by their shares.
    pub fn amount(&self, place: &SurfacePoint) -> f32 {
        if !place.exists() || !self.touches(place.object) {
            return 0.0;
        }
        if let Some(amount) = self.even_amount(place) {
            return amount;
        }
        let Reach { samples, weights, .. } = self.reach(place);
        let amount: f32 =
            samples.iter().zip(weights).map(|(sample, share)| self.amounts[*sample as usize] * share).sum();
        rounded(amount)
    }

    /// The amount where whatever samples are near have the same.
    fn even_amount(&self, place: &SurfacePoint) -> Option<f32> {
        let at = Vec3::from(place.position);
        let (x, y) = self.pixel(at)?;
        let sample = self.sample(x, y)?;
        let away = at.distance_squared(self.sampled.view.position[sample].into());
        let is_there = away < 0.5 * self.even[sample] && self.is_like(sample, place.object, place.normal.into());
        is_there.then(|| self.amounts[sample])
    }

    /// The three samples of the same object, turned alike, that are nearest to a place. Those that the edits' own camera
    /// saw beside it are looked at first.
    pub fn reach(&self, place: &SurfacePoint) -> Reach {
        if !place.exists() {
            return Reach::none(Found::NoSurface);
        }
        let (at, normal) = (Vec3::from(place.position), Vec3::from(place.normal));
        let mut near = [(f32::INFINITY, 0u32); 3];
        let mut widest = 0.0f32;
        let around = self.pixel(at).into_iter().flat_map(|(x, y)| self.around(x, y));
        for sample in around.filter(|sample| self.is_like(*sample, place.object, normal)) {
            let away = Vec3::from(self.sampled.view.position[sample]).distance_squared(at);
            widest = widest.max(away);
            let mut new = (away, sample as u32);
            for known in &mut near {
                if new.0 < known.0 {
                    std::mem::swap(known, &mut new);
                }
            }
        }
        // What lies behind what the camera saw there is not what it saw.
        if near[2].0.is_finite() && near[0].0 <= 0.5 * widest {
            let samples = near.map(|near| near.1);
            let weights = barycentric(at, normal, samples.map(|i| self.sampled.view.position[i as usize].into()));
            return Reach { found: Found::Seen, samples, weights };
        }
        self.carried.get_or_init(|| Carried::new(self.geometry, self.sampled)).reach(place, f32::INFINITY)
    }

    /// See `even`.
    fn evenness(&self, x: usize, y: usize) -> f32 {
        let (here, view) = (self.number(x, y), &self.sampled.view);
        if view.side[here] == NOWHERE {
            return 0.0;
        }
        let object = self.geometry.object[(view.side[here] / 2) as usize];
        if !self.touches(object) {
            return 0.0;
        }
        let (at, normal) = (Vec3::from(view.position[here]), Vec3::from(view.normal[here]));
        let (mut count, mut widest) = (0, 0.0f32);
        for there in self.around(x as i64, y as i64) {
            if !self.is_like(there, object, normal) || self.amounts[there] != self.amounts[here] {
                return 0.0;
            }
            count += 1;
            widest = widest.max(at.distance_squared(view.position[there].into()));
        }
        if count == 9 { widest } else { 0.0 }
    }

    /// Whether a sample is on an object, and turned alike.
    fn is_like(&self, sample: usize, object: u32, normal: Vec3) -> bool {
        let side = self.sampled.view.side[sample];
        side != NOWHERE
            && self.geometry.object[(side / 2) as usize] == object
            && Vec3::from(self.sampled.view.normal[sample]).dot(normal) >= ALIKE
    }

    /// Where in the edits' own picture a place would be, in samples; not always inside.
    fn pixel(&self, at: Vec3) -> Option<(i64, i64)> {
        let (pixel, _) = self.camera.project(at, Vec2::new(self.grid.0 as f32, self.grid.1 as f32))?;
        Some((pixel.x.floor() as i64, pixel.y.floor() as i64))
    }

    /// The samples at and around one, of those that are inside the picture.
    fn around(&self, x: i64, y: i64) -> impl Iterator<Item = usize> {
        (-1..=1).flat_map(move |j| (-1..=1).map(move |i| (x + i, y + j))).filter_map(|(x, y)| self.sample(x, y))
    }

    fn sample(&self, x: i64, y: i64) -> Option<usize> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        (x < self.grid.0 && y < self.grid.1).then(|| self.number(x, y))
    }

    /// Of a place of the grid, in the samples' order.
    fn number(&self, x: usize, y: usize) -> usize {
        let origin = &self.sampled.origin;
        let pixel = y / origin.down * origin.width + x / origin.across;
        pixel * origin.across * origin.down + y % origin.down * origin.across + x % origin.across
    }
}

/// An amount of edits that roundings do not tell apart from others: these would part places of a cache.
fn rounded(amount: f32) -> f32 {
    const STEPS: f32 = 4096.0;
    (amount * STEPS).round() / STEPS
}
