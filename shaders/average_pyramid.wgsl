// Averages over complete binary trees. Twin of src/kernels/average_pyramid.rs; uses shared/grid.wgsl.
// One workgroup takes `width` neighbouring nodes of a level up to their common ancestor, in workgroup memory.

struct Params {
    level: u32,     // first heap index of the level that is read (and how many nodes it has)
    width: u32,     // nodes a workgroup reads: a power of two, at most 256
    leaves: u32,    // leaves of each tree
    count: u32,     // trees
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> pyramid: array<vec4<f32>>;

var<workgroup> nodes: array<vec4<f32>, 256>;

@compute @workgroup_size(128)
fn average_pyramid(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ancestors = params.level / params.width;    // of one tree
    let index = group_index(group, groups);
    let inside = index < ancestors * params.count;
    let root = index / ancestors * 2u * params.leaves;
    let ancestor = index % ancestors;
    if inside {
        for (var i = lane; i < params.width; i += 128u) {
            nodes[i] = pyramid[root + params.level + ancestor * params.width + i];
        }
    }
    var level = params.level;
    for (var half = params.width / 2u; half > 0u; half /= 2u) {
        level /= 2u;
        workgroupBarrier();
        var node = vec4(0.0);
        if lane < half {
            node = (nodes[2u * lane] + nodes[2u * lane + 1u]) * 0.5;
        }
        workgroupBarrier();
        if lane < half {
            nodes[lane] = node;
            if inside {
                pyramid[root + level + ancestor * half + lane] = node;
            }
        }
    }
    if inside && lane == 0u && ancestors == 1u {
        pyramid[root] = vec4(0.0);
    }
}
