//! Texture coordinates that give every point of every surface a texel of its own.

use super::Atlas;
use super::fill::owners;
use crate::progress::Progress;
use crate::scene::Geometry;
use crate::{Error, Result};
use std::collections::HashMap;
use uvunwrap::{Density, MeshInput, Options};

/// Texels that two triangles may claim, as a share of all that are claimed: charts that touch within rounding.
const OVERLAP: f64 = 1e-3;
/// Empty texels around each chart: bilinear look-up reaches half a texel beyond an edge.
const PADDING: u32 = 2;

/// The file's own coordinates where they serve, new ones where not.
///
/// # Errors
/// No layout fits into `size` texels; `Cancelled`.
pub fn unwrap(geometry: &Geometry, size: usize, progress: Progress) -> Result<Atlas> {
    let own = Atlas { size, uvs: geometry.uvs.clone(), from_file: true };
    match serves(&own) {
        true => Ok(own),
        false => Ok(Atlas { size, uvs: laid_out(geometry, size, progress)?.into(), from_file: false }),
    }
}

/// Every triangle has an area inside of the unit square, and none lies on another.
fn serves(atlas: &Atlas) -> bool {
    let area = |[a, b, c]: &[[f32; 2]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    let inside = |uv: &[f32; 2]| uv.iter().all(|x| (0.0..=1.0).contains(x));
    if !atlas.uvs.iter().all(|uvs| area(uvs).abs() > 1e-12 && uvs.iter().all(inside)) {
        return false;
    }
    let (owners, claimed_twice) = owners(atlas);
    let claimed = owners.iter().filter(|owner| **owner != crate::scene::geometry::NONE).count();
    claimed_twice as f64 <= OVERLAP * claimed as f64
}

fn laid_out(geometry: &Geometry, size: usize, progress: Progress) -> Result<Vec<[[f32; 2]; 3]>> {
    // One mesh an object: charts do not span objects.
    let mut triangles_of: Vec<Vec<usize>> = vec![Vec::new(); geometry.objects.len()];
    (0..geometry.corners.len()).for_each(|t| triangles_of[geometry.object[t] as usize].push(t));
    triangles_of.retain(|triangles| !triangles.is_empty());
    let welded: Vec<(Vec<[f32; 3]>, Vec<u32>)> = triangles_of.iter().map(|list| weld(geometry, list)).collect();
    let meshes: Vec<MeshInput> = welded.iter().map(|(positions, indices)| MeshInput::new(positions, indices)).collect();
    let options = Options { density: Density::Auto { page_size: size as u32 }, padding: PADDING, ..Options::default() };
    let refused = |what: String| {
        Error::compute(
            format!("surfaces cannot be laid out on {size} x {size} texels: {what}"),
            "raise the size of texel_samples, or give the file texture coordinates that do not overlap",
        )
    };
    let atlas = match uvunwrap::generate_with_progress(&meshes, &options, |_| progress.check().is_ok()) {
        Err(uvunwrap::Error::Cancelled) => return Err(Error::Cancelled),
        other => other.map_err(|error| refused(error.to_string()))?,
    };
    if atlas.page_count > 1 {
        return Err(refused(format!("{} charts need {} pages", atlas.chart_count, atlas.page_count)));
    }
    // Pages are cropped to the rows in use.
    let scale = [atlas.width as f32 / size as f32, atlas.height as f32 / size as f32];
    let mut uvs = vec![[[0.0; 2]; 3]; geometry.corners.len()];
    for (mesh, triangles) in atlas.meshes.iter().zip(&triangles_of) {
        for (corners, &triangle) in mesh.indices.as_chunks::<3>().0.iter().zip(triangles) {
            uvs[triangle] = corners.map(|corner| {
                let [u, v] = mesh.vertices[corner as usize].uv;
                [u * scale[0], v * scale[1]]
            });
        }
    }
    Ok(uvs)
}

/// The corners of some triangles, each place once.
fn weld(geometry: &Geometry, triangles: &[usize]) -> (Vec<[f32; 3]>, Vec<u32>) {
    let mut known: HashMap<[u32; 3], u32> = HashMap::new();
    let mut positions = Vec::new();
    let indices = triangles
        .iter()
        .flat_map(|&triangle| geometry.corners[triangle])
        .map(|corner| {
            *known.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                positions.push(corner);
                positions.len() as u32 - 1
            })
        })
        .collect();
    (positions, indices)
}
