// Orthonormal 1D Haar encoding. Twin of src/kernels/haar_encode.rs; uses shared/grid.wgsl.
// One workgroup encodes one row of the matrix: every level of it in workgroup memory.

struct Params {
    rows: u32,      // rows of each vector's matrix
    width: u32,     // elements of a row: a power of two, at most 256
    length: u32,    // elements of each whole vector
    count: u32,     // vectors
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> averages: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> coefficients: array<vec4<f32>>;

const INV_SQRT_2: f32 = 0.70710677;

var<workgroup> row: array<vec4<f32>, 256>;

@compute @workgroup_size(128)
fn haar_encode(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group_index(group, groups);
    let inside = index < params.rows * params.count;
    let vector = index / params.rows;
    let r = index % params.rows;
    if inside {
        for (var i = lane; i < params.width; i += 128u) {
            row[i] = values[index * params.width + i];
        }
    }
    let first = vector * params.length;
    for (var half = params.width / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        var a = vec4(0.0);
        var b = vec4(0.0);
        if lane < half {
            a = row[2u * lane];
            b = row[2u * lane + 1u];
        }
        workgroupBarrier();
        if lane < half {
            row[lane] = (a + b) * INV_SQRT_2;
            if inside {
                coefficients[first + params.rows * half + r * half + lane] = (a - b) * INV_SQRT_2;
            }
        }
    }
    workgroupBarrier();
    if inside && lane == 0u {
        averages[index] = row[0];
        if params.rows == 1u {
            coefficients[first] = row[0];
        }
    }
}
