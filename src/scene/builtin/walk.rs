//! `builtin:walk`: a figure walks through a room, for edits that change over time.

use super::builder::Builder;
use crate::scene::{Camera, Light, LightKind, Material, Scene};
use glam::{Mat4, Quat, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, TAU};

/// Seconds that the walk takes; before, the figure stands ready, after, it stops in its tracks.
pub const SECONDS: f32 = 2.0;

/// From hip to knee, and from knee to the sole, metres; the sole is round.
const THIGH: f32 = 0.42;
const SHIN: f32 = 0.47;
const SOLE: f32 = 0.056;

/// A room of 5 x 2.7 x 3.6 m, open towards the camera: an orange wall on the left, a blue one on the right. A figure walks
/// from the orange wall past a couch to a basket, at 1.15 m/s; a spot light on the orange wall, a soft ceiling panel.
/// `time` in seconds.
pub fn walk(time: f32) -> Scene {
    let mut room = Builder::moving();
    let plaster = room.material("plaster", Material::matte([0.72, 0.71, 0.69]));
    let boards = room.material("boards", Material::matte([0.46, 0.36, 0.27]));
    let orange = room.material("orange", Material::matte([0.75, 0.25, 0.04]));
    let blue = room.material("blue", Material::matte([0.06, 0.13, 0.50]));
    let cloth = room.material("cloth", Material::matte([0.30, 0.36, 0.30]));
    let wicker = room.material("wicker", Material::matte([0.58, 0.46, 0.30]));
    let clay = room.material("clay", Material::matte([0.52, 0.50, 0.47]));
    let panel = room.material("panel", Material { emission: [5.0, 4.8, 4.5], ..Material::matte([0.8; 3]) });

    let (x, y, z) = (2.5, 2.7, 1.8);
    let v = Vec3::new;
    room.quad("floor", boards, [v(-x, 0.0, z), v(x, 0.0, z), v(x, 0.0, -z), v(-x, 0.0, -z)]);
    room.quad("ceiling", plaster, [v(-x, y, -z), v(x, y, -z), v(x, y, z), v(-x, y, z)]);
    room.quad("back_wall", plaster, [v(-x, 0.0, -z), v(x, 0.0, -z), v(x, y, -z), v(-x, y, -z)]);
    room.quad("left_wall", orange, [v(-x, 0.0, z), v(-x, 0.0, -z), v(-x, y, -z), v(-x, y, z)]);
    room.quad("right_wall", blue, [v(x, 0.0, -z), v(x, 0.0, z), v(x, y, z), v(x, y, -z)]);
    let lamp = [v(0.2, y - 0.01, -0.9), v(1.2, y - 0.01, -0.9), v(1.2, y - 0.01, -0.1), v(0.2, y - 0.01, -0.1)];
    room.quad("panel", panel, lamp);
    couch(&mut room, cloth);
    let basket = [[0.0, 0.0], [0.24, 0.0], [0.3, 0.5], [0.27, 0.5], [0.22, 0.04], [0.0, 0.04]].map(Vec2::from);
    room.lathe("basket", wicker, v(1.75, 0.0, 0.75), &basket, false);
    figure(&mut room, clay, time.clamp(0.0, SECONDS));

    let (from, to) = (v(0.3, 2.45, 1.5), v(-2.5, 1.1, -0.2));
    let spot = LightKind::Spot { position: from, direction: (to - from).normalize(), inner: 0.36, outer: 0.52 };
    let lights = vec![Light { name: "key".into(), kind: spot, intensity: Vec3::new(62.0, 56.0, 48.0) }];
    let camera = Camera::look_at("main", v(0.0, 1.45, 6.0), v(0.0, 1.15, 0.0), 32f32.to_radians());
    room.finish(lights, vec![camera])
}

fn couch(room: &mut Builder, cloth: u32) {
    let v = Vec3::new;
    room.cuboid("couch", cloth, v(0.1, 0.22, -1.25), v(2.0, 0.44, 0.85), 0.0);
    room.cuboid("couch", cloth, v(0.1, 0.62, -1.58), v(2.0, 0.42, 0.2), 0.0);
    for side in [-1.0, 1.0] {
        room.cuboid("couch", cloth, v(0.1 + 1.1 * side, 0.32, -1.25), v(0.22, 0.64, 0.85), 0.0);
    }
}

/// About 1.75 m tall; all of it is one object.
fn figure(room: &mut Builder, clay: u32, time: f32) {
    let stride = TAU * time;
    // Legs and arms of one side swing against each other, and against those of the other.
    let phase = |side: f32| stride + FRAC_PI_2 * (1.0 - side);
    let thigh = |side: f32| 0.48 * phase(side).sin();
    let knee = |side: f32| -(0.12 + 0.55 * (phase(side) - 0.9).sin().max(0.0));
    // The foot that is lower stands on the floor.
    let shin = |side: f32| (SHIN - SOLE) * (thigh(side) + knee(side)).cos() + SOLE;
    let leg = |side: f32| 0.02 + THIGH * thigh(side).cos() + shin(side);
    let hip = leg(-1.0).max(leg(1.0));
    // It walks along +X; limbs swing about Z.
    let body = Mat4::from_translation(Vec3::new(-1.6 + 1.15 * time, hip, 0.25));
    let joint = |at: Vec3, angle: f32| Mat4::from_rotation_translation(Quat::from_rotation_z(angle), at);
    room.segments = 28;
    room.placed(body, |room| {
        let torso = [
            [0.0, -0.12],
            [0.13, -0.08],
            [0.155, 0.0],
            [0.125, 0.2],
            [0.17, 0.42],
            [0.14, 0.52],
            [0.05, 0.57],
            [0.045, 0.64],
            [0.0, 0.64],
        ];
        room.lathe("figure", clay, Vec3::ZERO, &torso.map(Vec2::from), true);
        room.lathe("figure", clay, Vec3::new(0.02, 0.6, 0.0), &capsule(0.25, 0.105), true);
        for side in [-1.0, 1.0] {
            let swing = phase(side);
            let thigh = joint(Vec3::new(0.0, -0.02, 0.09 * side), thigh(side));
            let shin = joint(Vec3::new(0.0, -THIGH, 0.0), knee(side));
            let upper = joint(Vec3::new(0.0, 0.46, 0.2 * side), -0.42 * swing.sin());
            let lower = joint(Vec3::new(0.0, -0.28, 0.0), 0.35 + 0.2 * swing.cos());
            for (place, length, radius) in [
                (thigh, 0.46, 0.078),
                (thigh * shin, SHIN + SOLE, SOLE),
                (upper, 0.32, 0.052),
                (upper * lower, 0.3, 0.042),
            ] {
                room.placed(place, |room| {
                    let foot = Vec3::new(0.0, radius - length, 0.0);
                    room.lathe("figure", clay, foot, &capsule(length, radius), true);
                });
            }
        }
    });
}

/// A profile for `lathe`: a rod of that length with round ends.
fn capsule(length: f32, radius: f32) -> Vec<Vec2> {
    const STEPS: usize = 5;
    let arc = |from: f32, height: f32| {
        (0..=STEPS).map(move |step| {
            let (sin, cos) = (from + FRAC_PI_2 * step as f32 / STEPS as f32).sin_cos();
            // On the axis exactly, so that nothing is left of the triangles there.
            Vec2::new(if cos < 1e-6 { 0.0 } else { radius * cos }, height + radius * sin)
        })
    };
    arc(-FRAC_PI_2, radius).chain(arc(0.0, length - radius)).collect()
}
