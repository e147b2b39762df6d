// Harmonic mean distances. Twin of src/kernels/surroundings.rs; uses shared/grid.wgsl, shared/bvh.wgsl,
// shared/sampling.wgsl. One workgroup a point: its rays are shared out among 64 invocations.

struct Params {
    points: u32,    // of this page
    rays: u32,
    lift: f32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(4) var<storage, read_write> distances: array<f32>;

const LANES: u32 = 64u;

// Sum of inverse distances of each invocation.
var<workgroup> partial: array<f32, LANES>;

@compute @workgroup_size(64)
fn surroundings(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group_index(group, groups);
    var inverse_sum = 0.0;
    if index < params.points {
        let point = points[index];
        if point.object != NONE {
            for (var i = lane; i < params.rays; i += LANES) {
                let hit = closest_hit(unit_ray(point, lattice(i, params.rays, vec2(0.0))));
                if hit.triangle != NONE {
                    inverse_sum += 1.0 / hit.t;
                }
            }
        }
    }
    partial[lane] = inverse_sum;
    workgroupBarrier();
    if lane == 0u && index < params.points {
        var sum = 0.0;
        for (var i = 0u; i < LANES; i++) {
            sum += partial[i];
        }
        // FAR stands for infinite.
        distances[index] = FAR;
        if sum > 0.0 {
            distances[index] = f32(params.rays) / sum;
        }
    }
}

// About the triangle's own normal: no ray starts below it.
fn unit_ray(point: SurfacePoint, at: vec2<f32>) -> Ray {
    let axes = frame(point.geometric_normal);
    let local = cosine_direction(at);
    let origin = lifted(point.position, point.geometric_normal, params.lift);
    return Ray(origin, axes[0] * local.x + axes[1] * local.y + axes[2] * local.z, FAR);
}
