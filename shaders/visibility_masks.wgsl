// Binary visibility of one cube face from surface points, as bit masks. Twin of src/kernels/visibility_masks.rs; uses
// shared/grid.wgsl, shared/bvh.wgsl, shared/sampling.wgsl. One invocation a word of 32 texels, one ray a texel.

struct Params {
    lift: f32,
    points: u32,        // of this page
    face: u32,
    size: u32,          // texels along a side
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(4) var<storage, read> wanted: array<u32>;
@group(0) @binding(5) var<storage, read_write> masks: array<u32>;

@compute @workgroup_size(64)
fn visibility_masks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    let words = params.size * params.size / 32u;
    if n >= params.points * words {
        return;
    }
    let point = points[n / words];
    let word = n % words;
    var bits = 0u;
    // A tree of no nodes is one node of no triangles here: a buffer is never empty.
    if point.object != NONE {
        let origin = lifted(point.position, point.geometric_normal, params.lift);
        for (var i = 0u; i < 32u; i++) {
            if (wanted[word] >> i & 1u) != 0u {
                let towards = texel_direction(word * 32u + i);
                if dot(point.normal, towards) > 0.0 && !any_hit(Ray(origin, towards, FAR)) {
                    bits |= 1u << i;
                }
            }
        }
    }
    masks[n] = bits;
}

// The middle of a texel of the face, on the cube of half side 1 (src/scene/cube.rs).
fn texel_direction(texel: u32) -> vec3<f32> {
    let axis = params.face / 2u;
    let size = params.size;
    let u = f32(2u * (texel % size) + 1u) / f32(size) - 1.0;
    let v = f32(2u * (texel / size) + 1u) / f32(size) - 1.0;
    let straight = select(-1.0, 1.0, params.face % 2u == 0u);
    var towards = vec3(0.0);
    towards[axis] = straight;
    towards[(axis + 1u) % 3u] = u;
    towards[(axis + 2u) % 3u] = v;
    return towards;
}
