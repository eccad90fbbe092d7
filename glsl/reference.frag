// One frame's samples of the light that a fragment sends to the eye: paths through the scene, or without what else is
// there the shading integral of its surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "path.glsl"
#include "shown_channels.glsl"
#define SURFACE_TEXEL(map, at) textureLod(map, at, 0.0)
#define FOLLOWS_BODIES (TRANSPORT == TRANSPORT_ALL && rays_have(RAYS_REFRACTS))
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
bool look_through(inout PathPoint p, inout vec3 through, inout uvec4 seed)
{
    vec3 d = -p.s.v;
    RayHit hit = trace_seen(p.position - 2.0 * p.rounding * p.side, d, true);
    through *= p.s.transmission * hit.transmission;
    if (hit.t < 0.0) {
        through *= panorama_radiance(panorama_from_world(d));
        return false;
    }
    p = ray_point(hit, d);
    return look_into_hit(p, hit, d, through, seed);
}

void main()
{
    PathPoint p;
    p.s = read_surface();
    bool follows = FOLLOWS_BODIES && refracts(materials[instances[draw.instance].material]);
    // Coverage by chance: of all frames as many show the surface as it covers of what is behind.
    uvec3 layer = floatBitsToUint(position_world);
    bool is_through = BLENDS && !follows && unit_from_bits(pcg4d(uvec4(layer, frame.sample_index)).x) >= coverage(p.s);
    if (is_through && !(TINTS && TRANSPORT == TRANSPORT_ALL))
        discard;
    p.position = position_world;
    p.side = eye_side(p.s.v, p.s.n);
    p.rounding = position_rounding(p.position, distance(p.position, frame.eyes[eye].world_from_view[3].xyz));
    if (TRANSPORT == TRANSPORT_ALL)
        p.s.occlusion = 1.0; // occlusion maps estimate what paths find out
    vec3 sum = vec3(0.0), through = vec3(1.0);
    uvec4 seed = uvec4(gl_FragCoord.xy, frame.sample_index, (PATHS * eye) << 16u);
    if ((is_through && !look_through(p, through, seed))
        || (follows && !look_into_bodies(p, instances[draw.instance].material, !gl_FrontFacing, through, seed))) {
        radiance = vec4(PART == PART_ALL ? through : vec3(0.0), 1.0);
        return;
    }
    for (uint path = 0u; path < PATHS; ++path, seed.w += 1u << 16u)
        sum += transported_light(p, seed);
    radiance = vec4(through * shown_channels() * sum / float(PATHS), 1.0);
}
