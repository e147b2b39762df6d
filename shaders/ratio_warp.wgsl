// A picture of ratios at other places. Twin of src/kernels/ratio_warp.rs; uses shared/grid.wgsl.

struct Params {
    width: u32,     // of the source
    height: u32,
    targets: u32,   // places of this page
    pad0: u32,
}

struct Place {
    position: vec2<f32>,  // pixels of the source, (0, 0) in the middle of the first
    counts: vec2<u32>,    // look-ups along the sides; 0 for none
    sides: vec4<f32>,     // two vectors
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> places: array<Place>;
@group(0) @binding(3) var<storage, read_write> warped: array<vec4<f32>>;

@compute @workgroup_size(64)
fn ratio_warp(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    if n >= params.targets {
        return;
    }
    warped[n] = look_up(places[n]);
}

fn look_up(place: Place) -> vec4<f32> {
    let across = place.counts.x;
    let down = place.counts.y;
    let position = place.position;
    let a = place.sides.xy;
    let b = place.sides.zw;
    let reach = 0.5 * (abs(a) + abs(b)) + vec2(1.0);
    let size = vec2(f32(params.width), f32(params.height));
    let ahead = position + reach;
    let behind = position - reach - size + vec2(1.0);
    if across * down == 0u || min(ahead.x, ahead.y) <= 0.0 || max(behind.x, behind.y) >= 0.0 {
        return vec4(1.0);
    }
    if across * down == 1u {
        return bilinear(position);
    }
    var sum = vec4(0.0);
    for (var j = 0u; j < down; j++) {
        let corner = position + b * ((f32(j) + 0.5) / f32(down) - 0.5);
        for (var i = 0u; i < across; i++) {
            sum += bilinear(corner + a * ((f32(i) + 0.5) / f32(across) - 0.5));
        }
    }
    return sum / f32(across * down);
}

fn bilinear(position: vec2<f32>) -> vec4<f32> {
    let low = floor(position);
    let part = position - low;
    let x = i32(low.x);
    let y = i32(low.y);
    let above = row(x, y, part.x);
    let below = row(x, y + 1, part.x);
    return above + (below - above) * part.y;
}

fn row(x: i32, y: i32, part: f32) -> vec4<f32> {
    let left = fetch(x, y);
    return left + (fetch(x + 1, y) - left) * part;
}

fn fetch(x: i32, y: i32) -> vec4<f32> {
    if x < 0 || y < 0 || x >= i32(params.width) || y >= i32(params.height) {
        return vec4(1.0);
    }
    return values[u32(y) * params.width + u32(x)];
}
