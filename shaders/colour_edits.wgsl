// Ordered colour edits of atoms of light. Twin of src/kernels/colour_edits.rs; uses shared/grid.wgsl.
// One invocation a sample; its atoms are edited in place.

struct Params {
    samples: u32,       // samples of this page
    atoms: u32,         // atoms of each sample
    edits: u32,
    mask_words: u32,    // words of an edit's mask
}

struct Edit {
    matrix: mat3x3<f32>,
    first_knot: u32,
    knots: u32,         // 0: no curve
    receiver: u32,      // row of `given` with the weights, or NONE
    gain: u32,          // row of `given` with the gains, or NONE
    told: u32,          // row of `gains` to write, or NONE
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct Knot {
    x: f32,
    y: f32,
    slope: f32,
    pad: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> edits: array<Edit>;
@group(0) @binding(2) var<storage, read> masks: array<u32>;
@group(0) @binding(3) var<storage, read> knots: array<Knot>;
@group(0) @binding(4) var<storage, read> given: array<f32>;
@group(0) @binding(5) var<storage, read_write> atoms: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> totals: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> gains: array<f32>;

const DARK: f32 = 1e-20;
const LUMINANCE: vec3<f32> = vec3(0.2126, 0.7152, 0.0722);
const NONE: u32 = 0xffffffffu;

@compute @workgroup_size(64)
fn colour_edits(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    if n >= params.samples {
        return;
    }
    for (var e = 0u; e < params.edits; e++) {
        let gain = apply(e, n);
        if edits[e].told != NONE {
            gains[edits[e].told * params.samples + n] = gain;
        }
    }
    var sum = vec3(0.0);
    for (var a = 0u; a < params.atoms; a++) {
        sum += atoms[a * params.samples + n].xyz;
    }
    totals[n] = vec4(sum, 0.0);
}

fn apply(e: u32, n: u32) -> f32 {
    let edit = edits[e];
    var weight = 1.0;
    if edit.receiver != NONE {
        weight = given[edit.receiver * params.samples + n];
    }
    if weight == 0.0 {
        return 1.0;
    }
    var gain = 1.0;
    if edit.gain != NONE {
        gain = given[edit.gain * params.samples + n];
    } else if edit.knots != 0u {
        var sum = vec3(0.0);
        for (var a = 0u; a < params.atoms; a++) {
            if in_mask(e, a) {
                sum += atoms[a * params.samples + n].xyz;
            }
        }
        let luminance = dot(edit.matrix * sum, LUMINANCE);
        if luminance > DARK {
            gain = evaluate(edit.first_knot, edit.knots, luminance) / luminance;
        }
    }
    for (var a = 0u; a < params.atoms; a++) {
        if in_mask(e, a) {
            let light = atoms[a * params.samples + n].xyz;
            let edited = edit.matrix * light * gain;
            atoms[a * params.samples + n] = vec4(light + (edited - light) * weight, 0.0);
        }
    }
    return gain;
}

fn in_mask(e: u32, atom: u32) -> bool {
    return (masks[e * params.mask_words + atom / 32u] >> (atom % 32u) & 1u) == 1u;
}

fn evaluate(first_knot: u32, count: u32, x: f32) -> f32 {
    let first = knots[first_knot];
    let last = knots[first_knot + count - 1u];
    var y = 0.0;
    if x <= first.x {
        y = first.y + (x - first.x) * first.slope;
    } else if x >= last.x {
        y = last.y + (x - last.x) * last.slope;
    } else {
        // The last knot at or before x.
        var i = first_knot;
        var end = first_knot + count - 1u;
        while end - i > 1u {
            let middle = (i + end) / 2u;
            if knots[middle].x <= x {
                i = middle;
            } else {
                end = middle;
            }
        }
        y = hermite(knots[i], knots[i + 1u], x);
    }
    return max(y, 0.0);
}

fn hermite(a: Knot, b: Knot, x: f32) -> f32 {
    let width = b.x - a.x;
    let t = (x - a.x) / width;
    let u = 1.0 - t;
    return a.y * (1.0 + 2.0 * t) * u * u + a.slope * width * t * u * u + b.y * (3.0 - 2.0 * t) * t * t
        - b.slope * width * u * t * t;
}
