// Low-discrepancy points and the few maps that carry them to hemispheres and triangles. Same as
// src/transport/sampling.rs, function by function.

fn hash(x: u32) -> u32 {
    let state = x * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

fn unit(x: u32) -> f32 {
    return f32(x >> 8u) * (1.0 / 16777216.0);
}

fn shift(seed: u32) -> vec2<f32> {
    let first = hash(seed);
    return vec2(unit(first), unit(hash(first ^ 0x9e3779b9u)));
}

fn lattice(i: u32, n: u32, shift: vec2<f32>) -> vec2<f32> {
    let u = (f32(i) + 0.5) / f32(n) + shift.x;
    let v = unit(i * 2654435769u) + shift.y;
    return vec2(u - floor(u), v - floor(v));
}

fn cosine_direction(p: vec2<f32>) -> vec3<f32> {
    let radius = sqrt(p.x);
    let angle = 6.2831855 * p.y;
    return vec3(radius * cos(angle), radius * sin(angle), sqrt(max(1.0 - p.x, 0.0)));
}

// Columns: two unit vectors that make a right-handed frame with n, and n.
fn frame(n: vec3<f32>) -> mat3x3<f32> {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat3x3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

fn triangle_point(p: vec2<f32>) -> vec2<f32> {
    if p.y > p.x {
        let u = p.x * 0.5;
        return vec2(u, p.y - u);
    }
    let v = p.y * 0.5;
    return vec2(p.x - v, v);
}

fn lifted(position: vec3<f32>, geometric_normal: vec3<f32>, least: f32) -> vec3<f32> {
    let size = abs(position);
    return position + geometric_normal * max(1e-5 * max(size.x, max(size.y, size.z)), least);
}
