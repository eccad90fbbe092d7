// One frame's samples of the light that a fragment sends to the eye: paths through the scene, or without what else is
// there the shading integral of its surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "path.glsl"
#define SURFACE_TEXEL(map, at) textureLod(map, at, 0.0)
#include "surface.glsl"

layout(location = 0) out vec4 radiance;

// Paths per fragment and frame: bounded work, far below what any watchdog allows.
const uint PATHS = TRANSPORT == TRANSPORT_ALL ? 1 : 4;

void cut_out(float above)
{
    if (above < 0.0)
        discard;
}

// The triangle's own normal, towards the eye.
vec3 eye_side(vec3 v, vec3 otherwise)
{
    vec3 g = normalize_or(cross(dFdx(position_world), dFdy(position_world)), otherwise);
    return dot(g, v) < 0.0 ? -g : g;
}

void main()
{
    PathPoint p;
    p.s = read_surface();
    // Coverage by chance: of all frames as many show the surface as it covers of what is behind.
    uvec3 layer = floatBitsToUint(position_world);
    if (BLENDS && unit_from_bits(pcg4d(uvec4(layer, frame.sample_index)).x) >= p.s.alpha)
        discard;
    p.position = position_world;
    p.side = eye_side(p.s.v, p.s.n);
    p.rounding = position_rounding(p.position, distance(p.position, frame.eyes[eye].world_from_view[3].xyz));
    if (TRANSPORT == TRANSPORT_ALL)
        p.s.occlusion = 1.0; // occlusion maps estimate what paths find out
    vec3 sum = vec3(0.0);
    for (uint path = 0u; path < PATHS; ++path)
        sum += transported_light(p, uvec4(gl_FragCoord.xy, frame.sample_index, (PATHS * eye + path) << 16u));
    radiance = vec4(sum / float(PATHS), 1.0);
}
