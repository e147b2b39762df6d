// Rays against the binary hierarchy of src/scene/bvh.rs. A kernel that uses this binds `nodes` and `facets`.
// Box tests only decide what is skipped; hits come from the triangle test of src/scene/wide.rs, and among equally near
// ones the lowest triangle wins, so the order of the visit does not matter.

const NONE: u32 = 0xffffffffu;
// Infinity is not a WGSL number.
const FAR: f32 = 3e38;
const SLACK: f32 = 1.0000005;

struct Node {
    low: vec3<f32>,
    first: u32,
    high: vec3<f32>,
    count: u32,
}

struct Facet {
    corner: vec3<f32>,
    triangle: u32,
    edge_u: vec3<f32>,
    pad0: u32,
    edge_v: vec3<f32>,
    pad1: u32,
}

struct SurfacePoint {
    position: vec3<f32>,
    object: u32,
    normal: vec3<f32>,
    material: u32,
    geometric_normal: vec3<f32>,
    triangle: u32,
}

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    t_max: f32,
}

struct Hit {
    t: f32,
    triangle: u32,      // NONE for a miss
    u: f32,
    v: f32,
    front: bool,
    facet: u32,         // index into `facets`
}

fn closest_hit(ray: Ray) -> Hit {
    return traverse(ray, 0.0, false);
}

// The nearest hit farther along than t_min.
fn closest_hit_beyond(ray: Ray, t_min: f32) -> Hit {
    return traverse(ray, t_min, false);
}

fn any_hit(ray: Ray) -> bool {
    return traverse(ray, 0.0, true).triangle != NONE;
}

// Where the ray enters the box, or FAR when it does not before t_max.
fn enter(node: u32, origin: vec3<f32>, inverse: vec3<f32>, t_max: f32) -> f32 {
    let a = (nodes[node].low - origin) * inverse;
    let b = (nodes[node].high - origin) * inverse;
    let near = max(max(min(a.x, b.x), min(a.y, b.y)), max(min(a.z, b.z), 0.0));
    let leave = min(min(max(a.x, b.x), max(a.y, b.y)), min(max(a.z, b.z), t_max));
    return select(FAR, near, near <= leave * SLACK);
}

fn traverse(ray: Ray, t_min: f32, any: bool) -> Hit {
    // A zero component would make 0 x infinity; this is as good as parallel.
    let tiny = select(vec3(1e-20), vec3(-1e-20), ray.direction < vec3(0.0));
    let inverse = 1.0 / select(ray.direction, tiny, abs(ray.direction) < vec3(1e-20));
    var best = Hit(ray.t_max, NONE, 0.0, 0.0, true, 0u);
    // One entry a level; trees of 2^26 triangles are below 96 levels.
    var stack: array<u32, 96>;
    var depth = 0u;
    var node = 0u;
    if enter(0u, ray.origin, inverse, best.t) >= FAR {
        return best;
    }
    loop {
        let first = nodes[node].first;
        let count = nodes[node].count;
        if count > 0u {
            for (var i = first; i < first + count; i++) {
                intersect(i, ray, t_min, &best);
                if any && best.triangle != NONE {
                    return best;
                }
            }
        } else {
            let left = enter(first, ray.origin, inverse, best.t);
            let right = enter(first + 1u, ray.origin, inverse, best.t);
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
        if depth == 0u {
            return best;
        }
        depth -= 1u;
        node = stack[depth];
    }
    return best;
}

// Möller-Trumbore, both sides: takes the hit when it is nearer than the best.
fn intersect(i: u32, ray: Ray, t_min: f32, best: ptr<function, Hit>) {
    let edge_u = facets[i].edge_u;
    let edge_v = facets[i].edge_v;
    let p = cross(ray.direction, edge_v);
    let determinant = dot(edge_u, p);
    let inverse = 1.0 / determinant;
    let s = ray.origin - facets[i].corner;
    let u = dot(s, p) * inverse;
    let q = cross(s, edge_u);
    let v = dot(ray.direction, q) * inverse;
    let t = dot(edge_v, q) * inverse;
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > t_min && t <= (*best).t {
        let triangle = facets[i].triangle;
        if t < (*best).t || triangle < (*best).triangle {
            *best = Hit(t, triangle, u, v, determinant > 0.0, i);
        }
    }
}

fn normalize_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let size = length(v);
    if size > 0.0 && size < FAR {
        return v / size;
    }
    return other;
}
