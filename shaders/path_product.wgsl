// Product of sparse rows with a vector, entries changed by their ways. Twin of src/kernels/path_product.rs; uses
// shared/grid.wgsl. Four invocations share a row: lane l sums the entries l, l + 4, l + 8, ..., then the four sums are
// added.

struct Params {
    rows: u32,          // rows of this page
    first_entry: u32,   // number of the page's first entry among all entries
    index_bits: u32,    // high bits of an entry that hold the column
    is_signed: u32,     // the other bits are two's complement
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<u32>;
@group(0) @binding(3) var<storage, read> scale: array<f32>;
@group(0) @binding(4) var<storage, read> ways: array<u32>;
@group(0) @binding(5) var<storage, read> factors: array<f32>;   // by distance, then by direction
@group(0) @binding(6) var<storage, read> vector: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> products: array<vec4<f32>>;

const ROWS: u32 = 16u;
const CODES: u32 = 65536u;

var<workgroup> sums: array<vec4<f32>, 64>;

@compute @workgroup_size(64)
fn path_product(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32,
) {
    let row = group_index(group, groups) * ROWS + invocation / 4u;
    let lane = invocation % 4u;
    var sum = vec4(0.0);
    if row < params.rows {
        let end = offsets[row + 1u] - params.first_entry;
        for (var i = offsets[row] - params.first_entry + lane; i < end; i += 4u) {
            let entry = entries[i];
            let high = entry << params.index_bits;
            let weight = f32(select(
                bitcast<i32>(high >> params.index_bits),
                bitcast<i32>(high) >> params.index_bits,
                params.is_signed != 0u,
            ));
            let way = ways[i];
            let factor = factors[way >> 16u] * factors[CODES + (way & 0xffffu)];
            sum += vector[entry >> (32u - params.index_bits)] * (weight * factor);
        }
    }
    sums[invocation] = sum;
    workgroupBarrier();
    if row < params.rows && lane == 0u {
        let total = (sums[invocation] + sums[invocation + 1u]) + (sums[invocation + 2u] + sums[invocation + 3u]);
        products[row] = total * scale[row];
    }
}
