//! Compares pictures texel by texel, all layers of both: how golden images are judged.

use chiaro::image::{Image, Layer};

/// A texel is within when `|a - b| <= absolute + relative |b|` in all of its channels.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    pub absolute: f32,
    pub relative: f32,
    /// Share of a layer's texels that may be further off, where a ray takes the other side of an edge.
    pub outliers: f64,
}

/// Everything in which picture `a` is not the reference `b`; none when they are the same within tolerance.
pub fn faults(a: &Image, b: &Image, tolerance: Tolerance) -> Vec<String> {
    if (a.width, a.height) != (b.width, b.height) {
        return vec![format!("{} x {} pixels, expected {} x {}", a.width, a.height, b.width, b.height)];
    }
    let mut faults = Vec::new();
    for layer in a.layers.iter().filter(|layer| b.layer(&layer.name).is_none()) {
        faults.push(format!("layer {} is not expected", layer.title()));
    }
    for expected in &b.layers {
        match a.layer(&expected.name) {
            None => faults.push(format!("layer {} is missing", expected.title())),
            Some(layer) => faults.extend(fault(layer, expected, a.width, tolerance)),
        }
    }
    faults
}

fn fault(a: &Layer, b: &Layer, width: usize, tolerance: Tolerance) -> Option<String> {
    let title = b.title();
    if a.channels != b.channels || a.data.len() != b.data.len() {
        let values = |layer: &Layer| format!("{} values of {}", layer.data.len(), layer.channels.join(" "));
        return Some(format!("layer {title} has {}, expected {}", values(a), values(b)));
    }
    if let Some(at) = a.data.iter().zip(&b.data).position(|(a, b)| !a.is_finite() || !b.is_finite()) {
        return Some(format!("layer {title}: {} at value {at}, expected {}", a.data[at], b.data[at]));
    }
    let stride = b.channels.len();
    let excess = |a: f32, b: f32| (a - b).abs() - (tolerance.absolute + tolerance.relative * b.abs());
    let mut off: Vec<(usize, f32)> = (a.data.chunks(stride).zip(b.data.chunks(stride)).enumerate())
        .map(|(texel, (a, b))| (texel, a.iter().zip(b).map(|(a, b)| excess(*a, *b)).fold(f32::MIN, f32::max)))
        .filter(|(_, excess)| *excess > 0.0)
        .collect();
    let texels = b.data.len() / stride;
    if off.len() as f64 <= tolerance.outliers * texels as f64 {
        return None;
    }
    off.sort_by(|a, b| b.1.total_cmp(&a.1));
    let worst = off[0].0;
    let values = |layer: &Layer| format!("{:?}", &layer.data[worst * stride..][..stride]);
    let place = format!("at ({}, {})", worst % width, worst / width);
    let count = format!("{} of {texels} texels are off", off.len());
    Some(format!("layer {title}: {count}; the furthest {place} is {}, expected {}", values(a), values(b)))
}
