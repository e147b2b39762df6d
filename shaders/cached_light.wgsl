// Light at places by an irradiance cache. Twin of src/kernels/cached_light.rs, where each function has its like in
// src/transport/light_cache; uses shared/grid.wgsl. One invocation a place.

struct Params {
    low: vec3<f32>,
    inverse_width: f32,
    error: f32,
    levels: u32,        // bit l: grid l holds something
    cells: u32,         // less one
    count: u32,         // weights a place
    by_material: u32,
    points: u32,        // of this page
    pad0: u32,
    pad1: u32,
}

struct Cell {
    key: vec2<u32>,     // low word first; 0: no cell
    first: u32,
    count: u32,
}

struct Shape {
    position: vec3<f32>,
    reach2: f32,
    normal: vec3<f32>,
    inverse: f32,
    bend: f32,
    damping: f32,
    variance: f32,      // not asked for
    material: u32,
    kind: u32,          // a short cut of the CPU
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct Gradients {
    value: vec4<f32>,
    moved: array<vec4<f32>, 3>,
    turned: array<vec4<f32>, 3>,
}

struct SurfacePoint {
    position: vec3<f32>,
    object: u32,
    normal: vec3<f32>,
    material: u32,
    geometric_normal: vec3<f32>,
    triangle: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> records: array<u32>;
@group(0) @binding(4) var<storage, read> shapes: array<Shape>;
@group(0) @binding(5) var<storage, read> light: array<Gradients>;
@group(0) @binding(6) var<storage, read> receivers: array<f32>;
@group(0) @binding(7) var<storage, read> changes: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(9) var<storage, read> weights: array<f32>;
@group(0) @binding(10) var<storage, read_write> found: array<vec4<f32>>;

// Of src/scene/geometry.rs.
const NONE: u32 = 0xffffffffu;
// Of src/transport/light_cache/index.rs.
const BITS: u32 = 19u;

@compute @workgroup_size(64)
fn cached_light(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups) * 64u + lane;
    if i >= params.points {
        return;
    }
    // Light times weights, and their sum.
    var sum = vec4(0.0);
    let point = points[i];
    if point.object != NONE {
        // From wide to narrow cells.
        for (var levels = params.levels; levels != 0u; levels &= levels - 1u) {
            let cell = cell_at(firstTrailingBit(levels), point.position);
            for (var k = cell.first; k < cell.first + cell.count; k++) {
                let sphere = spheres[k];
                let by = point.position - sphere.xyz;
                if dot(by, by) < sphere.w {
                    sum += counted(records[k], point, i * params.count);
                }
            }
        }
    }
    if sum.w > 0.0 {
        sum = vec4(sum.xyz / sum.w, sum.w);
    }
    found[i] = sum;
}

// The cell of a grid that a place lies in; what lies outside of the grid counts as in its outermost cells.
fn cell_at(level: u32, place: vec3<f32>) -> Cell {
    let across = f32(1u << level);
    let scaled = (place - params.low) * (across * params.inverse_width);
    let at = vec3<u32>(clamp(scaled, vec3(0.0), vec3(across - 1.0)));
    // Cells' numbers along z, y and x after each other, below the grid's: 64 bits in two words.
    let key = vec2(
        at.x | at.y << BITS,
        at.y >> (32u - BITS) | at.z << (2u * BITS - 32u) | level << (3u * BITS - 32u) | 0x80000000u,
    );
    let mixed = (key.x * 0x9e3779b1u ^ key.y) * 0x85ebca6bu;
    var slot = (mixed ^ (mixed >> 15u)) & params.cells;
    // The table is at most half full, so an empty slot ends it.
    while any(cells[slot].key != key) && any(cells[slot].key != vec2(0u)) {
        slot = (slot + 1u) & params.cells;
    }
    return cells[slot];
}

// What a record adds at a place whose weights of receivers start at `first`: light times weight, and the weight.
fn counted(record: u32, point: SurfacePoint, first: u32) -> vec4<f32> {
    let shape = shapes[record];
    let by = point.position - shape.position;
    let squared = dot(by, by);
    if squared >= shape.reach2 {
        return vec4(0.0);
    }
    let apart = point.normal - shape.normal;
    let error = sqrt(squared) * shape.inverse + shape.bend * sqrt(0.5 * dot(apart, apart));
    // In front of it, a place sees what the record has behind itself.
    let is_in_front = dot(by, point.normal + shape.normal) * shape.inverse < -0.1 * params.error;
    if error >= params.error || is_in_front || part_ways(record, point.material, first) {
        return vec4(0.0);
    }
    let weight = 1.0 / max(error, 1e-3 * params.error) - 1.0 / params.error;
    if weight <= 0.0 {
        return vec4(0.0);
    }
    let all = light[record];
    let way = by * shape.damping;
    let turn = cross(shape.normal, point.normal);
    let moved = all.moved[0] * way.x + all.moved[1] * way.y + all.moved[2] * way.z;
    let turned = all.turned[0] * turn.x + all.turned[1] * turn.y + all.turned[2] * turn.z;
    var here = all.value + moved + turned;
    for (var e = 0u; e < params.count; e++) {
        let change = weights[first + e] - receivers[record * params.count + e];
        if change != 0.0 {
            here += changes[record * params.count + e] * change;
        }
    }
    // Gradients lead below what can be, edits may lead there on purpose.
    here = max(here, min(all.value, vec4(0.0)));
    return vec4(here.xyz * weight, weight);
}

// Something acts on the place alone, whose part the record does not have; or too much is different at once.
fn part_ways(record: u32, material: u32, first: u32) -> bool {
    if params.by_material != 0u && shapes[record].material != material {
        return true;
    }
    var untouched = false;
    var sum = 0.0;
    var squares = 0.0;
    for (var e = 0u; e < params.count; e++) {
        let here = receivers[record * params.count + e];
        let there = weights[first + e];
        untouched = untouched || (here == 0.0 && there != 0.0);
        let apart = abs(here - there);
        sum += apart;
        squares += apart * apart;
    }
    return untouched || sum * sum - squares > 0.1;
}
