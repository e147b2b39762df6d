// The way of each entry of sparse rows. Twin of src/kernels/entry_ways.rs and src/transport/ways.rs; uses
// shared/grid.wgsl. One workgroup a row.

struct Params {
    rows: u32,          // rows of this page
    first_entry: u32,   // number of the page's first entry among all entries
    index_bits: u32,    // high bits of an entry that hold the column
    pad0: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<u32>;
@group(0) @binding(3) var<storage, read> points: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> places: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> ways: array<u32>;

const STEPS: f32 = 1024.0;
const LOWEST: f32 = -24.0;
const SMALLEST: f32 = 1.17549435e-38;

@compute @workgroup_size(64)
fn entry_ways(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32,
) {
    let row = group_index(group, groups);
    if row >= params.rows {
        return;
    }
    let end = offsets[row + 1u] - params.first_entry;
    for (var i = offsets[row] - params.first_entry + invocation; i < end; i += 64u) {
        let node = entries[i] >> (32u - params.index_bits);
        ways[i] = pack(places[node].xyz - points[row].xyz);
    }
}

fn pack(between: vec3<f32>) -> u32 {
    let octaves = 0.5 * log2(max(dot(between, between), SMALLEST));
    let distance = u32(clamp((octaves - LOWEST) * STEPS + 0.5, 0.0, 65535.0));
    return distance << 16u | direction_code(between);
}

fn direction_code(v: vec3<f32>) -> u32 {
    let sum = abs(v.x) + abs(v.y) + abs(v.z);
    var p = vec2(0.0);
    if sum > 0.0 {
        p = v.xz / sum;
    }
    if v.y < 0.0 {
        p = (1.0 - abs(p.yx)) * select(vec2(-1.0), vec2(1.0), p >= vec2(0.0));
    }
    let code = clamp(p * 127.5 + 127.5 + 0.5, vec2(0.0), vec2(255.0));
    return u32(code.y) << 8u | u32(code.x);
}
