// What rays meet. Twin of src/kernels/trace_rays.rs; uses shared/grid.wgsl, shared/bvh.wgsl, shared/surface.wgsl.
// One invocation a ray.

struct Params {
    rays: u32,          // of this page
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct RayRecord {
    origin: vec3<f32>,
    t_max: f32,
    direction: vec3<f32>,
    t_min: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> corners: array<f32>;
@group(0) @binding(4) var<storage, read> normals: array<f32>;
@group(0) @binding(5) var<storage, read> object: array<u32>;
@group(0) @binding(6) var<storage, read> material: array<u32>;
@group(0) @binding(7) var<storage, read> rays: array<RayRecord>;
@group(0) @binding(8) var<storage, read_write> points: array<SurfacePoint>;
// Barycentrics of the hit, distance, nothing.
@group(0) @binding(9) var<storage, read_write> hits: array<vec4<f32>>;

@compute @workgroup_size(64)
fn trace_rays(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups) * 64u + lane;
    if i >= params.rays {
        return;
    }
    points[i] = SurfacePoint(vec3(0.0), NONE, vec3(0.0), NONE, vec3(0.0), NONE);
    hits[i] = vec4(0.0, 0.0, FAR, 0.0);
    let ray = rays[i];
    if ray.t_max <= 0.0 {
        return;
    }
    let hit = closest_hit_beyond(Ray(ray.origin, ray.direction, ray.t_max), ray.t_min);
    if hit.triangle == NONE {
        return;
    }
    points[i] = surface_point(hit);
    hits[i] = vec4(hit.u, hit.v, hit.t, 0.0);
}
