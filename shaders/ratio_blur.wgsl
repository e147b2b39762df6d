// One pass of five taps over a picture of ratios. Twin of src/kernels/ratio_blur.rs; uses shared/grid.wgsl.

struct Params {
    width: u32,
    height: u32,
    vertical: u32,  // 1 along columns, 0 along rows
    step: u32,      // pixels from tap to tap
    near: f32,      // weight at `step`
    far: f32,       // weight at `2 step`
    linked: u32,    // whether links are given
    pad0: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> near_links: array<u32>;
@group(0) @binding(3) var<storage, read> far_links: array<u32>;
@group(0) @binding(4) var<storage, read_write> blurred: array<vec4<f32>>;

@compute @workgroup_size(64)
fn ratio_blur(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups) * 64u + lane;
    if i >= params.width * params.height {
        return;
    }
    let value = values[i];
    if value.w == 0.0 {
        blurred[i] = value;
        return;
    }
    let vertical = params.vertical == 1u;
    let stride = select(1u, params.width, vertical);
    let length = select(params.width, params.height, vertical);
    let place = select(i % params.width, i / params.width, vertical);
    var sum = vec4(0.0);
    var total = 1.0 - 2.0 * (params.near + params.far);
    for (var k = 0u; k < 2u; k++) {
        let distance = params.step * (k + 1u);
        let weight = select(params.near, params.far, k == 1u);
        let left = min(place, distance);
        let right = min(length - 1u - place, distance);
        let j = i - left * stride;
        let l = i + right * stride;
        var back = weight * values[j].w;
        var ahead = weight * values[l].w;
        if params.linked == 1u {
            back *= select(0.0, link(k, j), left == distance);
            ahead *= select(0.0, link(k, i), right == distance);
        }
        sum += (values[j] - value) * back + (values[l] - value) * ahead;
        total += back + ahead;
    }
    blurred[i] = vec4((value + sum / total).xyz, value.w);
}

// How far a pixel and the one `step` (k = 0) or `2 step` (k = 1) further along lie on one surface.
fn link(k: u32, i: u32) -> f32 {
    var word = 0u;
    if k == 0u {
        word = near_links[i / 4u];
    } else {
        word = far_links[i / 4u];
    }
    return f32((word >> (8u * (i % 4u))) & 255u) / 255.0;
}
