// Exponentials forth and back along lines of a picture, in place; one line a lane. Twin of src/kernels/ratio_blur.rs;
// uses shared/grid.wgsl.

struct Params {
    lines: u32,
    length: u32,        // values of a line
    line_stride: u32,   // from line to line
    stride: u32,        // from value to value
    share: f32,
    linked: u32,        // whether links are given
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> links: array<u32>;
@group(0) @binding(2) var<storage, read_write> values: array<vec4<f32>>;

const LEAST: f32 = 1e-15;

@compute @workgroup_size(64)
fn ratio_blur(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let line = group_index(group, groups) * 64u + lane;
    if line >= params.lines {
        return;
    }
    let first = line * params.line_stride;
    var last = values[first];
    for (var i = 1u; i < params.length; i++) {
        let at = first + i * params.stride;
        last = blend(last, values[at], share(line, i - 1u));
        values[at] = last;
    }
    for (var i = params.length - 1u; i > 0u; i--) {
        let at = first + (i - 1u) * params.stride;
        last = blend(last, values[at], share(line, i - 1u));
        values[at] = last;
    }
}

fn blend(last: vec4<f32>, value: vec4<f32>, share: f32) -> vec4<f32> {
    let next = value + (last - value) * share;
    return select(next, vec4(0.0), abs(next) < vec4(LEAST));
}

// Between value i of a line and the next one.
fn share(line: u32, i: u32) -> f32 {
    if params.linked == 0u {
        return params.share;
    }
    let n = line * params.length + i;
    return params.share * (f32((links[n / 4u] >> (8u * (n % 4u))) & 255u) / 255.0);
}
