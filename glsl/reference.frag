// One frame's samples of the light that a fragment sends to the eye: paths through the scene, or without what else is
// there the shading integral of its surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "path.glsl"
#include "shown_channels.glsl"
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

// As chance takes it: where nothing is traced, for the colour that the frame shows of this pixel.
float coverage(Surface s)
{
    return TINTS && TRANSPORT != TRANSPORT_ALL ? 1.0 - (1.0 - s.alpha) * s.transmission[shown_channel()] : s.alpha;
}

// Goes on from a sheet to what is behind it. Where that is nothing, `through` becomes the panorama's light.
bool look_through(inout PathPoint p, out vec3 through)
{
    vec3 d = -p.s.v;
    RayHit hit = trace_ray(p.position - 2.0 * p.rounding * p.side, d, 1e30, false);
    through = p.s.transmission * hit.transmission;
    if (hit.t >= 0.0)
        p = ray_point(hit, d);
    else
        through *= PART == PART_ALL ? panorama_radiance(panorama_from_world(d)) : vec3(0.0);
    return hit.t >= 0.0;
}

void main()
{
    PathPoint p;
    p.s = read_surface();
    // Coverage by chance: of all frames as many show the surface as it covers of what is behind.
    uvec3 layer = floatBitsToUint(position_world);
    bool is_through = BLENDS && unit_from_bits(pcg4d(uvec4(layer, frame.sample_index)).x) >= coverage(p.s);
    if (is_through && !(TINTS && TRANSPORT == TRANSPORT_ALL))
        discard;
    p.position = position_world;
    p.side = eye_side(p.s.v, p.s.n);
    p.rounding = position_rounding(p.position, distance(p.position, frame.eyes[eye].world_from_view[3].xyz));
    if (TRANSPORT == TRANSPORT_ALL)
        p.s.occlusion = 1.0; // occlusion maps estimate what paths find out
    vec3 sum = vec3(0.0), through = vec3(1.0);
    if (is_through && !look_through(p, through)) {
        radiance = vec4(through, 1.0);
        return;
    }
    for (uint path = 0u; path < PATHS; ++path)
        sum += transported_light(p, uvec4(gl_FragCoord.xy, frame.sample_index, (PATHS * eye + path) << 16u));
    radiance = vec4(through * shown_channels() * sum / float(PATHS), 1.0);
}
