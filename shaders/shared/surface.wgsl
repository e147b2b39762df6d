// The point of a surface that a ray meets. Same as `Geometry::surface_point` (src/scene/geometry.rs).
// A kernel that uses this binds `facets`, `corners` and `normals` (three corners of three numbers a triangle), `object` and
// `material` (one a triangle).

fn surface_point(hit: Hit) -> SurfacePoint {
    let w = 1.0 - hit.u - hit.v;
    let first = 9u * hit.triangle;
    var position = vec3(0.0);
    var normal = vec3(0.0);
    for (var axis = 0u; axis < 3u; axis++) {
        let at = first + axis;
        position[axis] = corners[at] * w + corners[at + 3u] * hit.u + corners[at + 6u] * hit.v;
        normal[axis] = normals[at] * w + normals[at + 3u] * hit.u + normals[at + 6u] * hit.v;
    }
    let side = select(-1.0, 1.0, hit.front);
    let area_vector = cross(facets[hit.facet].edge_u, facets[hit.facet].edge_v);
    let geometric = normalize_or(area_vector, vec3(0.0)) * side;
    let shading = normalize_or(normal * side, geometric);
    return SurfacePoint(
        position, object[hit.triangle], shading, material[hit.triangle], geometric, hit.triangle,
    );
}
