// Light at samples from up to four rows each. Twin of src/kernels/interpolate.rs; uses shared/grid.wgsl.

struct Params {
    samples: u32,   // samples of this page
    rows: u32,      // elements of each vector
    count: u32,     // vectors
    pad0: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> indices: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> weights: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> rows: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> samples: array<vec4<f32>>;

@compute @workgroup_size(64)
fn interpolate(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    if n >= params.samples {
        return;
    }
    let four = indices[n];
    let weight = weights[n];
    for (var k = 0u; k < params.count; k++) {
        var sum = vec4(0.0);
        for (var j = 0u; j < 4u; j++) {
            if weight[j] != 0.0 {
                sum += rows[k * params.rows + four[j]] * weight[j];
            }
        }
        samples[k * params.samples + n] = sum;
    }
}
