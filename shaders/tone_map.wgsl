// Scene-linear light to display-linear colour. Twin of src/kernels/tone_map.rs; uses shared/grid.wgsl.

struct Params {
    pixels: u32,
    mode: u32,      // 0 none, 1 reinhard, 2 neutral
    gain: f32,      // 2 ^ exposure
    white: f32,     // luminance that reinhard maps to 1
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> pixels: array<vec4<f32>>;

const LUMINANCE: vec3<f32> = vec3(0.2126, 0.7152, 0.0722);
const F90: f32 = 0.04;
const START: f32 = 0.8 - F90;
const DESATURATION: f32 = 0.15;

@compute @workgroup_size(64)
fn tone_map(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    if n >= params.pixels {
        return;
    }
    let pixel = pixels[n];
    var colour = pixel.xyz * params.gain;
    switch params.mode {
        case 1u: { colour = reinhard(colour, params.white); }
        case 2u: { colour = neutral(colour); }
        default: {}
    }
    pixels[n] = vec4(colour, pixel.w);
}

fn reinhard(colour: vec3<f32>, white: f32) -> vec3<f32> {
    let luminance = max(dot(colour, LUMINANCE), 0.0);
    return colour * ((1.0 + luminance / white / white) / (1.0 + luminance));
}

fn neutral(scene: vec3<f32>) -> vec3<f32> {
    var colour = clamp(scene, vec3(0.0), vec3(1e30));
    let least = min(colour.x, min(colour.y, colour.z));
    let offset = select(F90, least - least * least / (4.0 * F90), least < 2.0 * F90);
    colour -= offset;
    let peak = max(colour.x, max(colour.y, colour.z));
    if peak < START {
        return colour;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let keep = 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    return colour * (new_peak / peak) * keep + vec3(new_peak * (1.0 - keep));
}
