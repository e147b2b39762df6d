// Rays of transfer rows. Twin of src/kernels/transfer_rows.rs; uses shared/grid.wgsl, shared/bvh.wgsl,
// shared/sampling.wgsl. One workgroup a row: its rays are shared out among 64 invocations.

struct Params {
    rows: u32,      // of this page
    rays: u32,
    gather: u32,
    credit: f32,
    lift: f32,
    spacing: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(4) var<storage, read> seeds: array<u32>;
@group(0) @binding(5) var<storage, read> samples: array<SurfacePoint>;
@group(0) @binding(6) var<storage, read> sides: array<vec4<u32>>;
@group(0) @binding(7) var<storage, read> cells: array<u32>;
@group(0) @binding(8) var<storage, read> radius2: array<f32>;
@group(0) @binding(9) var<storage, read_write> credited: array<u32>;
@group(0) @binding(10) var<storage, read_write> distances: array<vec2<f32>>;

const LANES: u32 = 64u;
const DEAD: u32 = 0xffffffffu;

// Sum of inverse distances, and least distance, of each invocation.
var<workgroup> partial: array<vec2<f32>, LANES>;

@compute @workgroup_size(64)
fn transfer_rows(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group_index(group, groups);
    var inverse_sum = 0.0;
    var least = FAR;
    if row < params.rows {
        let point = points[row];
        let turn = shift(seeds[row]);
        for (var i = lane; i < params.rays; i += LANES) {
            var found = Credit(0u, FAR);
            if point.object != NONE {
                found = follow(point, unit_ray(point, lattice(i, params.rays, turn)));
            }
            credited[row * params.rays + i] = found.node;
            if found.distance < FAR {
                inverse_sum += 1.0 / found.distance;
                least = min(least, found.distance);
            }
        }
    }
    partial[lane] = vec2(inverse_sum, least);
    workgroupBarrier();
    if lane == 0u && row < params.rows {
        var sum = vec2(0.0, FAR);
        for (var i = 0u; i < LANES; i++) {
            sum = vec2(sum.x + partial[i].x, min(sum.y, partial[i].y));
        }
        // FAR stands for infinite.
        distances[row] = select(vec2(FAR), vec2(f32(params.rays) / sum.x, sum.y), sum.y < FAR);
    }
}

fn unit_ray(point: SurfacePoint, at: vec2<f32>) -> Ray {
    let axes = frame(point.normal);
    let local = cosine_direction(at);
    let origin = lifted(point.position, point.geometric_normal, params.lift);
    return Ray(origin, axes[0] * local.x + axes[1] * local.y + axes[2] * local.z, FAR);
}

struct Credit {
    node: u32,      // 0 for none
    distance: f32,  // FAR for none
}

fn follow(point: SurfacePoint, ray: Ray) -> Credit {
    // Interpolated normals tilt some rays below the triangle itself.
    if dot(ray.direction, point.geometric_normal) <= 0.0 {
        return Credit(0u, FAR);
    }
    let hit = closest_hit(ray);
    if hit.triangle == NONE {
        return Credit(0u, FAR);
    }
    let side = sides[hit.triangle];
    let first = select(side.y, side.x, hit.front);
    if first == DEAD {
        return Credit(0u, hit.t);
    }
    let edge_u = facets[hit.facet].edge_u;
    let edge_v = facets[hit.facet].edge_v;
    var leaf = cells[first + cell_index(hit.u, hit.v, side.z)];
    if behind(point, leaf) {
        // The cell straddles the row's own surface: look again half a sample further out.
        let at = nudged(hit, edge_u, edge_v, point.geometric_normal * params.spacing);
        let other = cells[first + cell_index(at.x, at.y, side.z)];
        if !behind(point, other) {
            leaf = other;
        }
    }
    let area_vector = cross(edge_u, edge_v);
    let facing = max(abs(dot(area_vector, ray.direction)) / length(area_vector), 0.1);
    let cosine = max(dot(ray.direction, point.normal), 0.05);
    let patch_radius2 = hit.t * hit.t / (f32(params.rays) * cosine * facing);
    var node = params.gather + leaf;
    while node > 1u && radius2[node >> 1u] <= params.credit * patch_radius2 {
        node >>= 1u;
    }
    return Credit(node, hit.t);
}

// The row's point cannot see a sample below its own surface.
fn behind(point: SurfacePoint, leaf: u32) -> bool {
    return dot(samples[leaf].position - point.position, point.geometric_normal) < 0.0;
}

fn nudged(hit: Hit, edge_u: vec3<f32>, edge_v: vec3<f32>, by: vec3<f32>) -> vec2<f32> {
    let uu = dot(edge_u, edge_u);
    let uv = dot(edge_u, edge_v);
    let vv = dot(edge_v, edge_v);
    let du = dot(by, edge_u);
    let dv = dot(by, edge_v);
    let determinant = uu * vv - uv * uv;
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
