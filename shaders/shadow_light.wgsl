// Light that a change of visibility lets through. Twin of src/kernels/shadow_light.rs; uses shared/grid.wgsl.

struct Params {
    rows: u32,          // samples of this page
    directions: u32,
    lanes: u32,         // 1, or 3 for red, green, blue
    pad0: u32,
}

struct Beam {
    direction: vec4<f32>,
    energy: vec4<f32>,      // radiance times solid angle
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> beams: array<Beam>;
@group(0) @binding(2) var<storage, read> normals: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> change: array<f32>;
@group(0) @binding(4) var<storage, read_write> light: array<vec4<f32>>;

var<workgroup> parts: array<vec4<f32>, 64>;

@compute @workgroup_size(64)
fn shadow_light(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group_index(group, groups);
    if row >= params.rows {
        return;
    }
    let normal = normals[row].xyz;
    let plane = params.rows * params.directions;
    let last = params.lanes - 1u;
    var sum = vec4(0.0);
    for (var t = lane; t < params.directions; t += 64u) {
        let at = row * params.directions + t;
        let passes = vec4(change[at], change[min(1u, last) * plane + at], change[min(2u, last) * plane + at], 0.0);
        if any(passes != vec4(0.0)) {
            let cosine = max(dot(normal, beams[t].direction.xyz), 0.0);
            sum += passes * beams[t].energy * cosine;
        }
    }
    parts[lane] = sum;
    workgroupBarrier();
    if lane == 0u {
        var total = vec4(0.0);
        for (var i = 0u; i < 64u; i++) {
            total += parts[i];
        }
        light[row] = total;
    }
}
