// One step of an edit of shadows. Twin of src/kernels/shadow_filter.rs; uses shared/grid.wgsl.

struct Params {
    rows: u32,      // samples of this page
    inputs: u32,    // slots of a sample before
    outputs: u32,   // and after
    pad0: u32,
}

struct Tap {
    source: u32,
    weight: f32,
}

struct Slot {
    carry: u32,
    always: f32,
    mix: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read> taps: array<Tap>;
@group(0) @binding(3) var<storage, read> slots: array<Slot>;
@group(0) @binding(4) var<storage, read> amounts: array<f32>;
@group(0) @binding(5) var<storage, read> shadows: array<f32>;
@group(0) @binding(6) var<storage, read_write> filtered: array<f32>;

@compute @workgroup_size(64)
fn shadow_filter(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups) * 64u + lane;
    if i >= params.rows * params.outputs {
        return;
    }
    let row = i / params.outputs;
    let t = i % params.outputs;
    let first = row * params.inputs;
    let slot = slots[t];
    let carried = shadows[first + slot.carry];
    let share = slot.always + amounts[row] * slot.mix;
    var out = carried;
    if share != 0.0 {
        var sum = 0.0;
        for (var j = offsets[t]; j < offsets[t + 1u]; j++) {
            sum += taps[j].weight * shadows[first + taps[j].source];
        }
        out = carried + share * (sum - carried);
    }
    filtered[i] = out;
}
