// Product of sparse rows with up to four vectors. Twin of src/kernels/sparse_product.rs; uses shared/grid.wgsl.
// Four invocations share a row: lane l sums the entries l, l + 4, l + 8, ..., then the four sums are added.

struct Params {
    rows: u32,          // rows of this page
    first_entry: u32,   // number of the page's first entry among all entries
    columns: u32,       // elements of each vector
    count: u32,         // vectors, at most 4
    index_bits: u32,    // high bits of an entry that hold the column
    is_signed: u32,     // the other bits are two's complement
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<u32>;
@group(0) @binding(3) var<storage, read> scale: array<f32>;
@group(0) @binding(4) var<storage, read> vectors: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> products: array<vec4<f32>>;

const ROWS: u32 = 16u;

var<workgroup> sums: array<vec4<f32>, 256>;

@compute @workgroup_size(64)
fn sparse_product(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32,
) {
    let row = group_index(group, groups) * ROWS + invocation / 4u;
    let lane = invocation % 4u;
    var sum0 = vec4(0.0);
    var sum1 = vec4(0.0);
    var sum2 = vec4(0.0);
    var sum3 = vec4(0.0);
    if row < params.rows {
        let end = offsets[row + 1u] - params.first_entry;
        for (var i = offsets[row] - params.first_entry + lane; i < end; i += 4u) {
            let entry = entries[i];
            let index = entry >> (32u - params.index_bits);
            let high = entry << params.index_bits;
            let weight = f32(select(
                bitcast<i32>(high >> params.index_bits),
                bitcast<i32>(high) >> params.index_bits,
                params.is_signed != 0u,
            ));
            sum0 += vectors[index] * weight;
            if params.count > 1u {
                sum1 += vectors[params.columns + index] * weight;
            }
            if params.count > 2u {
                sum2 += vectors[2u * params.columns + index] * weight;
            }
            if params.count > 3u {
                sum3 += vectors[3u * params.columns + index] * weight;
            }
        }
    }
    sums[invocation] = sum0;
    sums[64u + invocation] = sum1;
    sums[128u + invocation] = sum2;
    sums[192u + invocation] = sum3;
    workgroupBarrier();
    // Now lane k adds up vector k.
    if row < params.rows && lane < params.count {
        let first = 64u * lane + invocation - lane;
        let sum = (sums[first] + sums[first + 1u]) + (sums[first + 2u] + sums[first + 3u]);
        products[lane * params.rows + row] = sum * scale[row];
    }
}
