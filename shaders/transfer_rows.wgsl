// Rays of transfer rows. Twin of src/kernels/transfer_rows.rs; uses shared/grid.wgsl, shared/bvh.wgsl,
// shared/sampling.wgsl, shared/credit.wgsl. One workgroup a row: its rays are shared out among 64 invocations.

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
                found = follow(point, unit_ray(point, lattice(i, params.rays, turn), params.lift));
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
    let leaf = leaf_at(point, hit, params.spacing);
    if leaf == DEAD {
        return Credit(0u, hit.t);
    }
    let share = f32(params.rays) * max(dot(ray.direction, point.normal), 0.05);
    let limit = params.credit * patch_radius2(hit, ray.direction, share);
    return Credit(climb(params.gather, leaf, limit), hit.t);
}
