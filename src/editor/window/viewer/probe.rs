//! What is under the pointer: numbers of the layer, and the surface.

use super::Viewer;
use crate::editor::shown::Shown;
use crate::image::Layer;
use glam::Vec2;

/// A line of text for a pixel.
pub fn text(viewer: &Viewer, at: Vec2) -> Option<String> {
    let shown = viewer.shown.as_ref()?;
    let (width, height) = (shown.picture.width, shown.picture.height);
    let (x, y) = (at.x.floor() as i64, at.y.floor() as i64);
    let is_in = (0..width as i64).contains(&x) && (0..height as i64).contains(&y);
    is_in.then(|| describe(shown, &viewer.settings.display.layer, x as usize, y as usize))
}

fn describe(shown: &Shown, layer: &str, x: usize, y: usize) -> String {
    let mut text = format!("{x}, {y}");
    let picture = &shown.picture;
    if let Some(layer) = picture.layer(layer).or(picture.layers.first()) {
        text += &format!("   {}", values(layer, y * picture.width + x));
    }
    if let Some(point) = shown.point(x, y) {
        let three = |v: [f32; 3], digits: usize| v.map(|x| format!("{x:.digits$}")).join(" ");
        let (position, normal) = (three(point.position, 3), three(point.normal, 2));
        text += &format!("   P {position} m   N {normal}   {} ({})", shown.object(point), shown.material(point));
    } else if shown.samples.is_some() {
        text += "   no surface";
    }
    text
}

fn values(layer: &Layer, pixel: usize) -> String {
    let stride = layer.channels.len();
    let numbers = &layer.data[pixel * stride..(pixel + 1) * stride];
    let named = layer.channels.iter().zip(numbers).map(|(channel, x)| format!("{channel} {}", number(*x)));
    named.collect::<Vec<_>>().join("  ")
}

fn number(x: f32) -> String {
    let size = x.abs();
    if x != 0.0 && !(1e-3..1e5).contains(&size) { format!("{x:.3e}") } else { format!("{x:.4}") }
}
