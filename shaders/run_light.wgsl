// Light over runs of bits, in wrapping integers. Twin of src/kernels/run_light.rs; uses shared/grid.wgsl.
// Four invocations share a row: lane l sums the runs l, l + 4, l + 8, ..., then the four sums are added.

struct Params {
    rows: u32,          // rows of this page
    first_toggle: u32,  // number of the page's first stored toggle among all
    last: u32,          // position behind the face's last texel
    is_narrow: u32,     // two toggles a word
    is_first: u32,      // sums start from 0
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read> words: array<u32>;
@group(0) @binding(3) var<storage, read> table: array<vec4<i32>>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4<i32>>;

const ROWS: u32 = 16u;

var<workgroup> parts: array<vec4<i32>, 192>;

fn toggle(i: u32) -> u32 {
    if params.is_narrow != 0u {
        return words[i / 2u] >> (16u * (i % 2u)) & 0xffffu;
    }
    return words[i];
}

@compute @workgroup_size(64)
fn run_light(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32,
) {
    let row = group_index(group, groups) * ROWS + invocation / 4u;
    let lane = invocation % 4u;
    var x = vec4(0);
    var y = vec4(0);
    var z = vec4(0);
    if row < params.rows {
        let behind = offsets[row + 1u] - params.first_toggle;
        for (var i = offsets[row] - params.first_toggle + 2u * lane; i < behind; i += 8u) {
            let start = 3u * toggle(i);
            var end = 3u * params.last;
            if i + 1u < behind {
                end = 3u * toggle(i + 1u);
            }
            x += table[end] - table[start];
            y += table[end + 1u] - table[start + 1u];
            z += table[end + 2u] - table[start + 2u];
        }
    }
    parts[invocation] = x;
    parts[64u + invocation] = y;
    parts[128u + invocation] = z;
    workgroupBarrier();
    // Now lane k adds up direction k.
    if row < params.rows && lane < 3u {
        let first = 64u * lane + invocation - lane;
        var sum = parts[first] + parts[first + 1u] + parts[first + 2u] + parts[first + 3u];
        let place = 3u * row + lane;
        if params.is_first == 0u {
            sum += sums[place];
        }
        sums[place] = sum;
    }
}
