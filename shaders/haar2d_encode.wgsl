// One level of the 2D Haar encoding of square pictures. Twin of src/kernels/haar2d_encode.rs; uses shared/grid.wgsl.
// An invocation encodes a square of four elements.

struct Params {
    half: u32,      // squares along a side
    side: u32,      // elements along a side of a whole picture
    count: u32,     // pictures
    pad0: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> fine: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> averages: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> coefficients: array<vec4<f32>>;

@compute @workgroup_size(64)
fn haar2d_encode(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let half = params.half;
    let n = group_index(group, groups) * 64u + lane;
    if n >= half * half * params.count {
        return;
    }
    let picture = n / (half * half);
    let y = n / half % half;
    let x = n % half;
    let at = 4u * half * (picture * half + y) + 2u * x;
    let a = fine[at];
    let b = fine[at + 1u];
    let c = fine[at + 2u * half];
    let d = fine[at + 2u * half + 1u];
    let average = ((a + b) + (c + d)) * 0.5;
    let first = picture * params.side * params.side;
    averages[n] = average;
    coefficients[first + y * params.side + x + half] = ((a - b) + (c - d)) * 0.5;
    coefficients[first + (y + half) * params.side + x] = ((a + b) - (c + d)) * 0.5;
    coefficients[first + (y + half) * params.side + x + half] = ((a - b) - (c - d)) * 0.5;
    if half == 1u {
        coefficients[first] = average;
    }
}
