// Which node of the gather tree a ray's hit is credited to. Same as src/kernels/shared/credit.rs, function by function.
// A kernel that uses this binds `facets`, `samples`, `sides`, `cells` and `radius2`.

const DEAD: u32 = 0xffffffffu;

// A cosine-distributed ray about the point's shading normal, lifted off its surface.
fn unit_ray(point: SurfacePoint, at: vec2<f32>, lift: f32) -> Ray {
    let axes = frame(point.normal);
    let local = cosine_direction(at);
    let origin = lifted(point.position, point.geometric_normal, lift);
    return Ray(origin, axes[0] * local.x + axes[1] * local.y + axes[2] * local.z, FAR);
}

// The gather sample nearest to a hit, as the point sees it; DEAD on a dead side.
fn leaf_at(point: SurfacePoint, hit: Hit, spacing: f32) -> u32 {
    let side = sides[hit.triangle];
    let first = select(side.y, side.x, hit.front);
    if first == DEAD {
        return DEAD;
    }
    let leaf = cells[first + cell_index(hit.u, hit.v, side.z)];
    if behind(point, leaf) {
        // The cell straddles the row's own surface: look again half a sample further out.
        let at = nudged(hit, point.geometric_normal * spacing);
        let other = cells[first + cell_index(at.x, at.y, side.z)];
        if !behind(point, other) {
            return other;
        }
    }
    return leaf;
}

// `gather`: number of gather samples.
fn climb(gather: u32, leaf: u32, limit: f32) -> u32 {
    var node = gather + leaf;
    while node > 1u && radius2[node >> 1u] <= limit {
        node >>= 1u;
    }
    return node;
}

fn patch_radius2(hit: Hit, direction: vec3<f32>, share: f32) -> f32 {
    let area_vector = cross(facets[hit.facet].edge_u, facets[hit.facet].edge_v);
    let facing = max(abs(dot(area_vector, direction)) / length(area_vector), 0.1);
    return hit.t * hit.t / (share * facing);
}

// A point cannot see a sample below its own surface.
fn behind(point: SurfacePoint, leaf: u32) -> bool {
    return dot(samples[leaf].position - point.position, point.geometric_normal) < 0.0;
}

fn nudged(hit: Hit, by: vec3<f32>) -> vec2<f32> {
    let edge_u = facets[hit.facet].edge_u;
    let edge_v = facets[hit.facet].edge_v;
    let uu = dot(edge_u, edge_u);
    let uv = dot(edge_u, edge_v);
    let vv = dot(edge_v, edge_v);
    let du = dot(by, edge_u);
    let dv = dot(by, edge_v);
    let determinant = uu * vv - uv * uv;
    // A sliver has no room to move in.
    if !(determinant > 1e-6 * uu * vv) {
        return vec2<f32>(hit.u, hit.v);
    }
    let u = clamp(hit.u + (du * vv - dv * uv) / determinant, 0.0, 1.0);
    let v = clamp(hit.v + (dv * uu - du * uv) / determinant, 0.0, 1.0 - u);
    return vec2(u, v);
}

fn cell_index(u: f32, v: f32, k: u32) -> u32 {
    let x = u * f32(k);
    let y = v * f32(k);
    let i = min(u32(x), k - 1u);
    let j = min(u32(y), k - 1u - i);
    let upper = (x - f32(i)) + (y - f32(j)) > 1.0 && i + j + 1u < k;
    return i * (2u * k - i) + 2u * j + select(0u, 1u, upper);
}
