// Whether anything lies on the way of rays. Twin of src/kernels/blocked_rays.rs; uses shared/grid.wgsl, shared/bvh.wgsl.
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
    t_min: f32,         // not asked for
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> rays: array<RayRecord>;
@group(0) @binding(4) var<storage, read_write> blocked: array<u32>;

@compute @workgroup_size(64)
fn blocked_rays(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups) * 64u + lane;
    if i >= params.rays {
        return;
    }
    let ray = rays[i];
    var is_blocked = true;
    if ray.t_max > 0.0 {
        is_blocked = any_hit(Ray(ray.origin, ray.direction, ray.t_max));
    }
    blocked[i] = select(0u, 1u, is_blocked);
}
