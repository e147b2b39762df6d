// Transfer rows point to point. Twin of src/kernels/transfer_points.rs; uses shared/grid.wgsl, shared/bvh.wgsl,
// shared/sampling.wgsl. One invocation a pair of row and gather sample.

struct Params {
    rows: u32,      // of this page
    gather: u32,
    area: f32,
    lift: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(4) var<storage, read> samples: array<SurfacePoint>;
@group(0) @binding(5) var<storage, read_write> weights: array<f32>;

const FRAC_1_PI: f32 = 0.31830988618;

@compute @workgroup_size(64)
fn transfer_points(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let pair = group_index(group, groups) * 64u + lane;
    if pair >= params.rows * params.gather {
        return;
    }
    weights[pair] = connect(points[pair / params.gather], samples[pair % params.gather]);
}

fn connect(point: SurfacePoint, sample: SurfacePoint) -> f32 {
    if point.object == NONE {
        return 0.0;
    }
    let origin = lifted(point.position, point.geometric_normal, params.lift);
    let between = lifted(sample.position, sample.geometric_normal, params.lift) - origin;
    let r2 = dot(between, between);
    let cos_v = dot(between, point.normal);
    let cos_g = -dot(between, sample.geometric_normal);
    if cos_v <= 0.0 || cos_g <= 0.0 || dot(between, point.geometric_normal) <= 0.0 {
        return 0.0;
    }
    if any_hit(Ray(origin, between, 1.0)) {
        return 0.0;
    }
    // The cosines are still multiplied by r each.
    return min(cos_v * cos_g / (r2 * r2) * FRAC_1_PI * params.area, 1.0);
}
