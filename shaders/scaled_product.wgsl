// Product of transfer rows, scaled by rows of edits, with up to four vectors. Twin of src/kernels/scaled_product.rs; uses
// shared/grid.wgsl. Four invocations share a pair of rows: lane l sums the entries l, l + 4, l + 8, ..., then the four
// sums are added.

struct Params {
    pairs: u32,
    first_entry: u32,   // number of the page's first entry among all entries
    columns: u32,       // elements of each vector
    count: u32,         // vectors, at most 4
    index_bits: u32,    // high bits of an entry that hold the node
    is_signed: u32,     // the other bits are two's complement
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<u32>;
@group(0) @binding(3) var<storage, read> scale: array<f32>;
@group(0) @binding(4) var<storage, read> vectors: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> pairs: array<vec2<u32>>;     // transfer row of this page, first record of the tree
@group(0) @binding(6) var<storage, read> trees: array<vec4<u32>>;     // bits of three factors, first record of the children
@group(0) @binding(7) var<storage, read_write> products: array<vec4<f32>>;

const PAIRS: u32 = 16u;
const UNSCALED: u32 = 0xffffffffu;

var<workgroup> sums: array<vec4<f32>, 256>;

// The factors at a node: down from the root, as far as they differ below.
fn factor(tree: u32, node: u32) -> vec4<f32> {
    if tree == UNSCALED {
        return vec4(1.0);
    }
    var record = trees[tree];
    for (var below = firstLeadingBit(node | 1u); below > 0u && record.w != 0u; below -= 1u) {
        record = trees[tree + record.w + ((node >> (below - 1u)) & 1u)];
    }
    return vec4(bitcast<vec3<f32>>(record.xyz), 1.0);
}

@compute @workgroup_size(64)
fn scaled_product(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32,
) {
    let index = group_index(group, groups) * PAIRS + invocation / 4u;
    let lane = invocation % 4u;
    var row = 0u;
    var sum0 = vec4(0.0);
    var sum1 = vec4(0.0);
    var sum2 = vec4(0.0);
    var sum3 = vec4(0.0);
    if index < params.pairs {
        row = pairs[index].x;
        let tree = pairs[index].y;
        let end = offsets[row + 1u] - params.first_entry;
        for (var i = offsets[row] - params.first_entry + lane; i < end; i += 4u) {
            let entry = entries[i];
            let node = entry >> (32u - params.index_bits);
            let high = entry << params.index_bits;
            let weight = factor(tree, node) * f32(select(
                bitcast<i32>(high >> params.index_bits),
                bitcast<i32>(high) >> params.index_bits,
                params.is_signed != 0u,
            ));
            sum0 += vectors[node] * weight;
            if params.count > 1u {
                sum1 += vectors[params.columns + node] * weight;
            }
            if params.count > 2u {
                sum2 += vectors[2u * params.columns + node] * weight;
            }
            if params.count > 3u {
                sum3 += vectors[3u * params.columns + node] * weight;
            }
        }
    }
    sums[invocation] = sum0;
    sums[64u + invocation] = sum1;
    sums[128u + invocation] = sum2;
    sums[192u + invocation] = sum3;
    workgroupBarrier();
    // Now lane k adds up vector k.
    if index < params.pairs && lane < params.count {
        let first = 64u * lane + invocation - lane;
        let sum = (sums[first] + sums[first + 1u]) + (sums[first + 2u] + sums[first + 3u]);
        products[lane * params.pairs + index] = sum * scale[row];
    }
}
