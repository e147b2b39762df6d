// Binary visibility of one cube face from surface points, as bit masks. Twin of src/kernels/visibility_masks.rs; uses
// shared/grid.wgsl, shared/bvh.wgsl, shared/sampling.wgsl. One invocation a row of texels: it walks the binary hierarchy,
// nearest first, through what the row cuts, and closes the spans of triangles. Rows share nothing, so nothing waits.
//
// As on the CPU, a point is (x, y, z) = (along u, along v, out of the face), from the eye, and the plane of an edge is
// made from its corners in sorted order, so that triangles that share it cut a row at the same place.

struct Params {
    lift: f32,
    points: u32,        // of this page
    face: u32,
    size: u32,          // texels along a side
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> corners: array<f32>;       // nine a triangle, in the order of `facets`
@group(0) @binding(4) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(5) var<storage, read> wanted: array<u32>;
@group(0) @binding(6) var<storage, read_write> masks: array<u32>;

// Same as in src/kernels/visibility_masks/walk.rs.
const TEXELS_SLACK: f32 = 2e-3;
const NEAR: f32 = 1e-30;
const WORDS: u32 = 16u;     // of a row of 512 texels

struct Row {
    eye: vec3<f32>,
    y: f32,
    size: f32,
    words: u32,
    open: array<u32, WORDS>,
}

@compute @workgroup_size(64)
fn visibility_masks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    if n >= params.points * params.size {
        return;
    }
    let point = points[n / params.size];
    var row: Row;
    row.y = f32(n % params.size);
    row.size = f32(params.size);
    row.words = params.size / 32u;
    if point.object != NONE {
        row.eye = turned(lifted(point.position, point.geometric_normal, params.lift));
        open_row(point.normal, n % params.size, &row);
        walk(&row);
    }
    for (var word = 0u; word < row.words; word++) {
        masks[n * row.words + word] = row.open[word];
    }
}

// World coordinates as the face has them.
fn turned(p: vec3<f32>) -> vec3<f32> {
    let out = select(-1.0, 1.0, params.face % 2u == 0u);
    if params.face < 2u {
        return vec3(p.y, p.z, p.x * out);
    }
    if params.face < 4u {
        return vec3(p.z, p.x, p.y * out);
    }
    return vec3(p.x, p.y, p.z * out);
}

// Opens the wanted texels above the horizon.
fn open_row(normal: vec3<f32>, y: u32, row: ptr<function, Row>) {
    let up = turned(normal);
    let side = up.y * middle(y);
    for (var x = 0u; x < params.size; x++) {
        let along = up.x * middle(x);
        // In the order of the world's x, y, z.
        var height = (along + side) + up.z;
        if params.face < 2u {
            height = (up.z + along) + side;
        } else if params.face < 4u {
            height = (side + up.z) + along;
        }
        if height > 0.0 {
            (*row).open[x / 32u] |= 1u << (x % 32u);
        }
    }
    for (var word = 0u; word < (*row).words; word++) {
        (*row).open[word] &= wanted[y * (*row).words + word];
    }
}

fn middle(x: u32) -> f32 {
    return f32(2u * x + 1u) / f32(params.size) - 1.0;
}

fn closed(row: ptr<function, Row>) -> bool {
    var any = 0u;
    for (var word = 0u; word < (*row).words; word++) {
        any |= (*row).open[word];
    }
    return any == 0u;
}

// The texels from `left` to `right` that lie in a word.
fn span(word: u32, left: i32, right: i32) -> u32 {
    let first = max(left - i32(word * 32u), 0);
    let last = min(right - i32(word * 32u), 31);
    if first > 31 || last < first {
        return 0u;
    }
    return (0xffffffffu << u32(first)) & (0xffffffffu >> u32(31 - last));
}

fn walk(row: ptr<function, Row>) {
    // One entry a level, as in shared/bvh.wgsl.
    var stack: array<u32, 96>;
    var depth = 0u;
    var node = 0u;
    if reach(0u, row) >= FAR || closed(row) {
        return;
    }
    loop {
        let first = nodes[node].first;
        let count = nodes[node].count;
        if count > 0u {
            for (var i = first; i < first + count; i++) {
                draw(i, row);
            }
            if closed(row) {
                return;
            }
        } else {
            let left = reach(first, row);
            let right = reach(first + 1u, row);
            if left < FAR || right < FAR {
                let right_first = right < left;
                node = select(first, first + 1u, right_first);
                if left < FAR && right < FAR {
                    stack[depth] = select(first + 1u, first, right_first);
                    depth += 1u;
                }
                continue;
            }
        }
        // What waited may have been closed meanwhile.
        loop {
            if depth == 0u {
                return;
            }
            depth -= 1u;
            node = stack[depth];
            if reach(node, row) < FAR {
                break;
            }
        }
    }
}

// Depth of the nearest point of a box that may cover an open texel of the row; FAR when none does.
fn reach(node: u32, row: ptr<function, Row>) -> f32 {
    let a = turned(nodes[node].low) - (*row).eye;
    let b = turned(nodes[node].high) - (*row).eye;
    let low = min(a, b);
    let high = max(a, b);
    if !(high.z > 0.0) {
        return FAR;
    }
    let near_scale = 1.0 / max(low.z, NEAR);
    let far_scale = 1.0 / max(high.z, NEAR);
    let half = 0.5 * (*row).size;
    let lower = min(low.xy * near_scale, low.xy * far_scale) * half + (half - 0.5) - TEXELS_SLACK;
    let upper = max(high.xy * near_scale, high.xy * far_scale) * half + (half - 0.5) + TEXELS_SLACK;
    if lower.y > (*row).y || upper.y < (*row).y {
        return FAR;
    }
    let left = i32(clamp(ceil(lower.x), 0.0, (*row).size));
    let right = i32(clamp(floor(upper.x), -1.0, (*row).size - 1.0));
    for (var word = 0u; word < (*row).words; word++) {
        if ((*row).open[word] & span(word, left, right)) != 0u {
            return max(low.z, 0.0);
        }
    }
    return FAR;
}

fn corner(triangle: u32, i: u32) -> vec3<f32> {
    let at = 9u * triangle + 3u * i;
    return turned(vec3(corners[at], corners[at + 1u], corners[at + 2u]));
}

// Texels that are left of the row and right of it, as long as nothing bounds them.
struct Span {
    left: f32,
    right: f32,
}

fn draw(triangle: u32, row: ptr<function, Row>) {
    let a = corner(triangle, 0u);
    let b = corner(triangle, 1u);
    let c = corner(triangle, 2u);
    let first = b - a;
    let third = c - a;
    let start = a - (*row).eye;
    // The volume spanned by eye and triangle: its sign says on which side of its plane the eye is.
    let volume = dot(cross(first, third), start);
    if !(volume > 0.0 || volume < 0.0) {
        return;
    }
    var bounds = Span(0.0, (*row).size - 1.0);
    // Directions d in the triangle have plane . d of the volume's sign, for the third edge of the other.
    bound(start, first, volume > 0.0, row, &bounds);
    bound(b - (*row).eye, c - b, volume > 0.0, row, &bounds);
    bound(start, third, volume < 0.0, row, &bounds);
    let left = i32(min(ceil(bounds.left), (*row).size));
    let right = i32(max(floor(bounds.right), -1.0));
    for (var word = 0u; word < (*row).words; word++) {
        (*row).open[word] &= ~span(word, left, right);
    }
}

// Cuts a span where the plane through the eye, `start` and `start + edge` cuts the row: it keeps the side where directions
// d have plane . d positive, or negative.
fn bound(start: vec3<f32>, edge: vec3<f32>, positive: bool, row: ptr<function, Row>, bounds: ptr<function, Span>) {
    let plane = cross(start, edge);
    // A plane along the row is tilted by far less than rounding does.
    let least = max(1e-12 * max(abs(plane.y), abs(plane.z)), 1e-37);
    let rightwards = plane.x > 0.0;
    let across = select(-1.0, 1.0, rightwards) * max(abs(plane.x), least);
    let slope = -plane.y / across;
    let half = 0.5 * (*row).size;
    let at = (slope * (1.0 / (*row).size - 1.0) - plane.z / across) * half + (half - 0.5);
    let x = slope * (*row).y + at;
    if rightwards == positive {
        (*bounds).left = max((*bounds).left, x);
    } else {
        (*bounds).right = min((*bounds).right, x);
    }
}
