// What the rays of transfer rows would meet behind their first hit. Twin of src/kernels/hidden_rows.rs; uses
// shared/grid.wgsl, shared/bvh.wgsl, shared/sampling.wgsl, shared/credit.wgsl. One workgroup a row: its rays are shared
// out among 64 invocations.

struct Params {
    rows: u32,      // of this page
    rays: u32,
    gather: u32,
    credit: f32,
    lift: f32,
    spacing: f32,
    layers: u32,
    walk: u32,
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
@group(0) @binding(9) var<storage, read> admitted: array<u32>;
@group(0) @binding(10) var<storage, read_write> credited: array<u32>;
@group(0) @binding(11) var<storage, read_write> dropped: array<u32>;

const LANES: u32 = 64u;

// What each invocation dropped.
var<workgroup> partial: array<u32, LANES>;

@compute @workgroup_size(64)
fn hidden_rows(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group_index(group, groups);
    var lost = 0u;
    if row < params.rows {
        let point = points[row];
        let turn = shift(seeds[row]);
        for (var i = lane; i < params.rays; i += LANES) {
            let first = (row * params.rays + i) * params.layers;
            for (var layer = 0u; layer < params.layers; layer++) {
                credited[first + layer] = 0u;
            }
            if point.object != NONE {
                lost += follow(point, unit_ray(point, lattice(i, params.rays, turn), params.lift), first);
            }
        }
    }
    partial[lane] = lost;
    workgroupBarrier();
    if lane == 0u && row < params.rows {
        var sum = 0u;
        for (var i = 0u; i < LANES; i++) {
            sum += partial[i];
        }
        dropped[row] = sum;
    }
}

// Writes the nodes of a ray from `first` on; how many there was no room for.
fn follow(point: SurfacePoint, ray: Ray, first: u32) -> u32 {
    // Interpolated normals tilt some rays below the triangle itself.
    if dot(ray.direction, point.geometric_normal) <= 0.0 {
        return 0u;
    }
    let share = f32(params.rays) * max(dot(ray.direction, point.normal), 0.05);
    var layer = 0u;
    var lost = 0u;
    var hit = closest_hit(ray);
    for (var step = 0u; step < params.walk; step++) {
        if hit.triangle == NONE {
            return lost;
        }
        // Surfaces that coincide count once, and so does one that is hit on the edge between its triangles.
        hit = closest_hit_beyond(ray, hit.t * 1.00001 + params.lift);
        if hit.triangle == NONE {
            return lost;
        }
        let leaf = leaf_at(point, hit, params.spacing);
        if leaf == DEAD {
            continue;
        }
        let limit = params.credit * patch_radius2(hit, ray.direction, share);
        let node = climb(params.gather, leaf, limit);
        if admitted[node] == 0u {
            continue;
        }
        if layer < params.layers {
            credited[first + layer] = node;
            layer += 1u;
        } else {
            lost += 1u;
        }
    }
    return lost + 1u;
}
