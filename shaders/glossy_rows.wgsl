// Rays of glossy rows. Twin of src/kernels/glossy_rows.rs; uses shared/grid.wgsl, shared/bvh.wgsl, shared/sampling.wgsl,
// shared/credit.wgsl. One workgroup a row: its rays are shared out among 64 invocations.

struct Params {
    eye: vec3<f32>,
    lift: f32,
    rows: u32,      // of this page
    rays: u32,
    gather: u32,
    credit: f32,
    spacing: f32,
    alpha: f32,
    model: u32,     // 0: GGX, 1: Blinn-Phong
    pad0: u32,
}

struct Share {
    node: u32,      // 0 for none
    weight: f32,
    fresnel: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(4) var<storage, read> seeds: array<u32>;
@group(0) @binding(5) var<storage, read> samples: array<SurfacePoint>;
@group(0) @binding(6) var<storage, read> sides: array<vec4<u32>>;
@group(0) @binding(7) var<storage, read> cells: array<u32>;
@group(0) @binding(8) var<storage, read> radius2: array<f32>;
@group(0) @binding(9) var<storage, read_write> shares: array<Share>;
@group(0) @binding(10) var<storage, read_write> distances: array<vec2<f32>>;

const LANES: u32 = 64u;
const PI: f32 = 3.1415927;
const TAU: f32 = 6.2831855;

// Sum of inverse distances, and least distance, of each invocation.
var<workgroup> partial: array<vec2<f32>, LANES>;

@compute @workgroup_size(64)
fn glossy_rows(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group_index(group, groups);
    var inverse_sum = 0.0;
    var least = FAR;
    if row < params.rows {
        let point = points[row];
        let seed = seeds[row];
        let view = place_view(point);
        for (var i = lane; i < params.rays; i += LANES) {
            var found = Followed(Share(0u, 0.0, 0.0), FAR);
            if point.object != NONE {
                found = follow(point, view, i, seed);
            }
            shares[row * params.rays + i] = found.share;
            if found.distance < FAR {
                inverse_sum += 1.0 / found.distance;
                least = min(least, found.distance);
            }
        }
    }
    partial[lane] = vec2(inverse_sum, least);
    workgroupBarrier();
    if lane == 0u && row < params.rows {
        var sum = vec2(0.0, FAR);
        for (var i = 0u; i < LANES; i++) {
            sum = vec2(sum.x + partial[i].x, min(sum.y, partial[i].y));
        }
        // FAR stands for infinite.
        distances[row] = select(vec2(FAR), vec2(f32(params.rays) / sum.x, sum.y), sum.y < FAR);
    }
}

// A place as its lobe sees it.
struct View {
    origin: vec3<f32>,
    axes: mat3x3<f32>,  // about the normal
    eye: vec3<f32>,     // in that frame
}

fn place_view(point: SurfacePoint) -> View {
    let origin = lifted(point.position, point.geometric_normal, params.lift);
    let eye = normalize_or(params.eye - origin, point.normal);
    var normal = point.normal;
    // Interpolated normals may turn away from an eye that sees the surface: bent until they just face it.
    let facing = dot(normal, eye);
    if facing < 0.01 {
        normal = normalize_or(normal + eye * (0.01 - facing), eye);
    }
    let axes = frame(normal);
    return View(origin, axes, vec3(dot(axes[0], eye), dot(axes[1], eye), dot(normal, eye)));
}

// A direction drawn from a lobe.
struct Drawn {
    light: vec3<f32>,   // in the frame of the lobe
    weight: f32,        // BRDF cos over density, but for the Fresnel term; 0 below the horizon
    grazing: f32,       // Fresnel's p
    density: f32,       // per solid angle
}

fn smith(a2: f32, cosine: f32) -> f32 {
    return sqrt(a2 + (1.0 - a2) * cosine * cosine);
}

fn ggx(eye: vec3<f32>, alpha: f32, at: vec2<f32>) -> Drawn {
    // The caps: a sphere cut at the height of the stretched eye.
    let stretched = normalize(vec3(alpha * eye.x, alpha * eye.y, eye.z));
    let z = (1.0 - at.x) * (1.0 + stretched.z) - stretched.z;
    let radius = sqrt(max(1.0 - z * z, 0.0));
    let angle = TAU * at.y;
    let cap = vec3(radius * cos(angle), radius * sin(angle), z) + stretched;
    let half_way = normalize_or(vec3(alpha * cap.x, alpha * cap.y, max(cap.z, 0.0)), vec3(0.0, 0.0, 1.0));
    let towards = dot(eye, half_way);
    let light = half_way * (2.0 * towards) - eye;
    let a2 = alpha * alpha;
    let view_term = smith(a2, eye.z);
    let light_term = smith(a2, light.z);
    let weight = light.z * (eye.z + view_term) / (eye.z * light_term + light.z * view_term);
    let d = half_way.z * half_way.z * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * d * d);
    return Drawn(light, weight, fifth(1.0 - towards), distribution / (2.0 * (eye.z + view_term)));
}

fn blinn(eye: vec3<f32>, alpha: f32, at: vec2<f32>) -> Drawn {
    let a2 = alpha * alpha;
    // cos² = u^alpha²; its complement without the rounding of 1 - cos².
    let exponent = a2 * log(max(at.x, 1e-12));
    let sin2 = select(1.0 - exp(exponent), -exponent * (1.0 + exponent * (0.5 + exponent / 6.0)), exponent > -0.01);
    let angle = TAU * at.y;
    let radius = sqrt(sin2);
    let half_way = vec3(radius * cos(angle), radius * sin(angle), sqrt(max(1.0 - sin2, 1e-12)));
    let towards = dot(eye, half_way);
    let light = half_way * (2.0 * towards) - eye;
    // D = cos^(2/alpha² - 2) / (pi alpha²), by the same power.
    let distribution = max(at.x, 1e-12) / (max(1.0 - sin2, 1e-12) * PI * a2);
    var weight = 0.0;
    if towards > 0.0 {
        let masking = min(2.0 * half_way.z * min(eye.z, light.z) / towards, 1.0);
        weight = masking * towards / (eye.z * half_way.z);
    }
    let density = distribution * half_way.z / (4.0 * max(towards, 1e-6));
    return Drawn(light, weight, fifth(1.0 - towards), density);
}

fn fifth(x: f32) -> f32 {
    let y = clamp(x, 0.0, 1.0);
    let squared = y * y;
    return squared * squared * y;
}

struct Followed {
    share: Share,
    distance: f32,  // FAR for none
}

fn follow(point: SurfacePoint, view: View, i: u32, seed: u32) -> Followed {
    let nothing = Share(0u, 0.0, 0.0);
    let at = lattice(i, params.rays, shift(seed));
    var drawn: Drawn;
    if params.model == 1u {
        drawn = blinn(view.eye, params.alpha, at);
    } else {
        drawn = ggx(view.eye, params.alpha, at);
    }
    if !(drawn.light.z > 0.0 && drawn.weight > 0.0) {
        return Followed(nothing, FAR);
    }
    var direction = view.axes * drawn.light;
    // Interpolated normals tilt some rays below the triangle itself: mirrored up, they keep the lobe's energy.
    direction -= point.geometric_normal * (2.0 * min(dot(direction, point.geometric_normal), 0.0));
    var hit = closest_hit(Ray(view.origin, direction, FAR));
    if hit.triangle == NONE {
        return Followed(nothing, FAR);
    }
    // The samples are no mirror image: looked up about one sample around, they make a smooth one.
    let area_vector = cross(facets[hit.facet].edge_u, facets[hit.facet].edge_v);
    let moved = nudged(hit, jitter(area_vector, i, seed) * params.spacing);
    hit.u = moved.x;
    hit.v = moved.y;
    let leaf = leaf_at(point, hit, params.spacing);
    if leaf == DEAD {
        return Followed(nothing, hit.t);
    }
    let share = f32(params.rays) * max(PI * drawn.density, 0.05);
    let limit = params.credit * patch_radius2(hit, direction, share);
    let scale = drawn.weight / (PI * f32(params.rays));
    let node = climb(params.gather, leaf, limit);
    return Followed(Share(node, scale * (1.0 - drawn.grazing), scale * drawn.grazing), hit.t);
}

// A vector in a plane, even over the unit disc: for ray i the next point of a lattice (Roberts 2018).
fn jitter(area_vector: vec3<f32>, i: u32, seed: u32) -> vec3<f32> {
    let p = vec2(unit(i * 3242174889u), unit(i * 2447445414u)) + shift(seed ^ 0x68bc21ebu);
    let axes = frame(normalize_or(area_vector, vec3(0.0, 0.0, 1.0)));
    let angle = TAU * (p.y - floor(p.y));
    return (axes[0] * cos(angle) + axes[1] * sin(angle)) * sqrt(p.x - floor(p.x));
}
