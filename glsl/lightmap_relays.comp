// Follows light from the lamps, evenly to all sides, and from what shines to the first places that it meets.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

// Where and how light number `i` leaves all that shines; false where none does.
bool from_emitter(uint i, out vec3 origin, out vec3 d)
{
    RayHit hit = sample_emitter(sobol(i, pcg4d(uvec4(1u)).xy));
    uvec4 bits = pcg4d(uvec4(i, 0u, 8u, 0u));
    vec3 front = mat3(frame.world_from_models) * normalize_or(bvh_normal(hit.triangle), vec3(0.0, 1.0, 0.0));
    bool back = unit_from_bits(bits.z) >= emitted_to_side(hit.triangle, false);
    PathPoint p = ray_point(hit, back ? front : -front);
    d = basis(p.side) * cosine_direction(units_from_bits(bits.xy));
    origin = ray_origin(p);
    return is_shining(hit, p.s.emission);
}

// The same of light from the lamps, evenly to all sides.
bool from_lamp(uint i, out vec3 origin, out vec3 d)
{
    origin = lights[i % lamp_count()].position;
    d = sphere_direction(sobol(i / lamp_count(), pcg4d(uvec4(0u)).xy));
    return true;
}

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    // Where there are both, they take turns.
    uint turns = has_emitters() && lamp_count() > 0u ? 2u : 1u, i = index / turns;
    bool is_of_emitter = has_emitters() && index % turns == 0u;
    vec3 origin, d;
    bool leaves = is_of_emitter ? from_emitter(i, origin, d) : from_lamp(i, origin, d);
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
