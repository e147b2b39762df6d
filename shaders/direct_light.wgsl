// Direct light at surface points. Twin of src/kernels/direct_light.rs; uses shared/grid.wgsl, shared/bvh.wgsl,
// shared/sampling.wgsl. One invocation a point.

struct LightRecord {
    position: vec3<f32>,
    kind: u32,
    direction: vec3<f32>,
    cos_outer: f32,
    intensity: vec3<f32>,
    cone_scale: f32,
    seed: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct Emitter {
    corner: vec3<f32>,
    cumulative: f32,
    edge_u: vec3<f32>,
    two_sided: u32,
    edge_v: vec3<f32>,
    pad0: u32,
    radiance: vec3<f32>,
    pad1: u32,
}

struct Params {
    light: LightRecord,
    eye: vec3<f32>,
    lift: f32,
    points: u32,        // of this page
    emitters: u32,
    samples: u32,
    highlights: u32,
    first: u32,         // number of the page's first point
    materials: u32,     // in `gloss`
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
@group(0) @binding(3) var<storage, read> points: array<SurfacePoint>;
@group(0) @binding(4) var<storage, read> emitters: array<Emitter>;
@group(0) @binding(5) var<storage, read> gloss: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> irradiance: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> highlights: array<vec4<f32>>;

const SPOT: u32 = 1u;
const DIRECTIONAL: u32 = 2u;
const EMITTERS: u32 = 3u;
const PI: f32 = 3.1415927;

struct Sum {
    irradiance: vec3<f32>,
    highlight: vec3<f32>,
}

@compute @workgroup_size(64)
fn direct_light(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = group_index(group, groups) * 64u + lane;
    if n >= params.points {
        return;
    }
    var sum = Sum(vec3(0.0), vec3(0.0));
    let point = points[n];
    if point.object != NONE {
        shade(point, params.first + n, &sum);
    }
    irradiance[n] = vec4(sum.irradiance, 0.0);
    if params.highlights == 1u {
        highlights[n] = vec4(sum.highlight, 0.0);
    }
}

fn shade(point: SurfacePoint, index: u32, sum: ptr<function, Sum>) {
    // All is measured from where shadow rays start: from below, a lifted ray to a lamp close by would end behind it.
    let origin = lifted(point.position, point.geometric_normal, params.lift);
    let light = params.light;
    if light.kind == DIRECTIONAL {
        add(point, origin, -light.direction, FAR, light.intensity, sum);
        return;
    }
    if light.kind == EMITTERS {
        shade_emitters(point, origin, index, sum);
        return;
    }
    let to_light = light.position - origin;
    let distance = length(to_light);
    if distance > 0.0 {
        let towards = to_light / distance;
        var cone = 1.0;
        if light.kind == SPOT {
            let t = clamp((dot(-towards, light.direction) - light.cos_outer) * light.cone_scale, 0.0, 1.0);
            cone = t * t;
        }
        add(point, origin, towards, distance, light.intensity * (cone / (distance * distance)), sum);
    }
}

fn shade_emitters(point: SurfacePoint, origin: vec3<f32>, index: u32, sum: ptr<function, Sum>) {
    let turn = shift(index ^ params.light.seed);
    for (var i = 0u; i < params.samples; i++) {
        let pick = (f32(i) + turn.x) / f32(params.samples);
        let chosen = choose(pick);
        let emitter = emitters[chosen];
        var before = 0.0;
        if chosen > 0u {
            before = emitters[chosen - 1u].cumulative;
        }
        let share = emitter.cumulative - before;
        let y = unit(i * 2654435769u) + turn.y;
        let at = triangle_point(vec2(clamp((pick - before) / share, 0.0, 1.0), y - floor(y)));
        let towards = emitter.corner + emitter.edge_u * at.x + emitter.edge_v * at.y - origin;
        let distance = length(towards);
        let area_vector = cross(emitter.edge_u, emitter.edge_v) * 0.5;
        var facing = -dot(area_vector, towards) / distance;
        facing = select(max(facing, 0.0), abs(facing), emitter.two_sided == 1u);
        let bounded = facing / (distance * distance * share);
        if bounded < FAR {
            // No sample may bring more than a sky full of its light: close to a lamp rare ones would sparkle.
            let weight = min(bounded, PI) / f32(params.samples);
            add(point, origin, towards / distance, distance * 0.9999, emitter.radiance * weight, sum);
        }
    }
}

// The first emitter whose cumulative share is above the pick, or the last.
fn choose(pick: f32) -> u32 {
    var low = 0u;
    var high = params.emitters;
    while low < high {
        let middle = (low + high) / 2u;
        if emitters[middle].cumulative <= pick {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return min(low, params.emitters - 1u);
}

fn add(
    point: SurfacePoint,
    origin: vec3<f32>,
    towards: vec3<f32>,
    distance: f32,
    power: vec3<f32>,
    sum: ptr<function, Sum>,
) {
    let cosine = dot(point.normal, towards);
    if cosine <= 0.0 || dot(point.geometric_normal, towards) <= 0.0 || all(power == vec3(0.0)) {
        return;
    }
    if any_hit(Ray(origin, towards, distance)) {
        return;
    }
    (*sum).irradiance += power * cosine;
    if params.highlights == 1u && point.material < params.materials {
        let eye = normalize_or(params.eye - origin, vec3(0.0));
        (*sum).highlight += power * cosine * highlight(point.normal, eye, towards, gloss[point.material]);
    }
}

fn highlight(normal: vec3<f32>, eye: vec3<f32>, light: vec3<f32>, material: vec4<f32>) -> vec3<f32> {
    let half_way = normalize_or(eye + light, vec3(0.0));
    let nv = dot(normal, eye);
    let nl = dot(normal, light);
    let nh = dot(normal, half_way);
    let vh = dot(eye, half_way);
    let f0 = material.xyz;
    if nv <= 0.0 || nl <= 0.0 || all(f0 == vec3(0.0)) {
        return vec3(0.0);
    }
    let alpha = max(material.w * material.w, 1e-3);
    let a2 = alpha * alpha;
    let d = nh * nh * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * d * d);
    let masking = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
    let grazing = clamp(1.0 - vh, 0.0, 1.0);
    let fresnel = f0 + (vec3(1.0) - f0) * (grazing * grazing * grazing * grazing * grazing);
    return fresnel * (distribution * masking);
}
