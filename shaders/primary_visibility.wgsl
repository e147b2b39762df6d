// What each view sample sees. Twin of src/kernels/primary_visibility.rs; uses shared/grid.wgsl, shared/bvh.wgsl,
// shared/surface.wgsl. One invocation a sample.

struct Params {
    position: vec3<f32>,
    width: u32,
    right: vec3<f32>,
    height: u32,
    up: vec3<f32>,
    samples: u32,       // of a pixel
    back: vec3<f32>,
    first: u32,         // number of the page's first sample
    count: u32,         // samples of this page
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
// Three corners of three numbers a triangle.
@group(0) @binding(3) var<storage, read> corners: array<f32>;
@group(0) @binding(4) var<storage, read> normals: array<f32>;
// Object and material of each triangle.
@group(0) @binding(5) var<storage, read> object: array<u32>;
@group(0) @binding(6) var<storage, read> material: array<u32>;
@group(0) @binding(7) var<storage, read> offsets: array<vec2<f32>>;
@group(0) @binding(8) var<storage, read_write> points: array<SurfacePoint>;
@group(0) @binding(9) var<storage, read_write> barycentrics: array<vec2<f32>>;

@compute @workgroup_size(64)
fn primary_visibility(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    if n >= params.count {
        return;
    }
    let i = params.first + n;
    let pixel = i / params.samples;
    let offset = offsets[i % params.samples];
    let x = f32(pixel % params.width) + offset.x;
    let y = f32(pixel / params.width) + offset.y;
    let sx = 2.0 * x / f32(params.width) - 1.0;
    let sy = 1.0 - 2.0 * y / f32(params.height);
    let direction = params.right * sx + params.up * sy - params.back;
    let hit = closest_hit(Ray(params.position, direction, FAR));
    if hit.triangle == NONE {
        points[n] = SurfacePoint(vec3(0.0), NONE, vec3(0.0), NONE, vec3(0.0), NONE);
        barycentrics[n] = vec2(0.0);
        return;
    }
    points[n] = surface_point(hit);
    barycentrics[n] = vec2(hit.u, hit.v);
}
