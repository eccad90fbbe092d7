// Follows light from the lamps, evenly to all sides, and from what shines to the first places that it meets.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

// The origin and the direction of light number `i` from all that shines; false where none leaves.
bool from_emitter(uint i, out vec3 origin, out vec3 d)
{
    vec4 random = vec4(sobol(i, pcg4d(uvec4(1u)).xy), units_from_bits(pcg4d(uvec4(i, 0u, 8u, 0u)).xy));
    RayHit hit = sample_emitter(random.xy);
    vec3 front = mat3(frame.world_from_models) * normalize_or(bvh_normal(hit.triangle), vec3(0.0, 1.0, 0.0));
    bool back = unit_from_bits(pcg4d(uvec4(i, 0u, 9u, 0u)).x) >= emitted_to_side(hit.triangle, false);
    vec3 side = back ? -front : front;
    PathPoint p = ray_point(hit, -side);
    d = basis(side) * cosine_direction(random.zw);
    origin = ray_origin(p);
    bool is_masked = (bvh_triangles[hit.triangle].material_and_flags & BVH_MASKED) != 0u;
    return p.s.emission != vec3(0.0) && !(is_masked && is_hole(hit));
}

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    float of_emitters = relays_of_emitters();
    bool leaves = true;
    vec3 origin, d;
    if (of_emitters == 1.0 || (of_emitters > 0.0 && index % 2u == 1u))
        leaves = from_emitter(of_emitters == 1.0 ? index : index / 2u, origin, d);
    else {
        uint i = of_emitters > 0.0 ? index / 2u : index;
        origin = lights[i % frame.light_count].position;
        d = sphere_direction(sobol(i / frame.light_count, pcg4d(uvec4(0u)).xy));
    }
    relays[index] = Relay(vec3(0.0), d, vec3(0.0), 0.0, 0u, vec3(0.0), vec3(0.0));
    if (!leaves)
        return;
    RayHit hit = trace_ray(origin, d, 1e30, false);
    if (hit.t < 0.0)
        return;
    PathPoint p = ray_point(hit, d);
    vec3 at = lightmap_address(hit, is_back(hit, d));
    vec4 given = textureLod(given_back_of_direct, at, 0.0);
    uint glossy = textureLod(given_back_of_soft, at, 0.0).a > 0.5 ? RELAY_GLOSSY : 0u;
    vec3 position = p.position + 2.0 * p.rounding * p.side;
    relays[index] = Relay(position, p.side, given.rgb, given.a, hit.triangle | glossy, hit.weights, at);
}
