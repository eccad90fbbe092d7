// Light that comes to a probe from all sides, in the models' space: what the lightmap's texels give back. Between them nothing
// comes, and alpha has the share of that: the panorama lies behind.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"
#include "given_back.glsl"
#include "probe_box.glsl"
#include "tone.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(PROBE_DIRECT) uniform sampler2DArray given_back_of_direct;
layout(PROBE_SOFT) uniform sampler2DArray given_back_of_soft;
layout(PROBE_CAPTURE, rgba32f) uniform writeonly image2DArray capture;
layout(push_constant, scalar) uniform Work {
    vec3 position; // in the models' space
    uint first_row;
    uint rows;
    vec3 low, high; // rays begin where they leave this box
    vec3 walls_low, walls_high; // what was captured is taken to lie on this box
} work;

// As far as where a box has no wall.
const float NO_WALL = 1e9;

// Rays along each side of a texel.
const uint RAYS = 2;

// The walls lie nearer than this part of the way to their box.
const float BEYOND_WALL = 1.1;

// What rays see through before they meet a wall, at most.
const uint MOST_HITS = 8;

// Whether it is part of a sphere light, which is added to what probes show.
bool is_of_sphere(RayHit hit)
{
    return (bvh_triangle(hit.triangle).material_and_flags & BVH_SPHERE) != 0u;
}

vec3 given_back(RayHit hit, vec3 d_world)
{
    vec3 at = lightmap_address(hit, is_back(hit, d_world));
    vec3 light = textureLod(given_back_of_direct, at, 0.0).rgb + textureLod(given_back_of_soft, at, 0.0).rgb;
    light *= towards_over_matt(hit, hit_cosine(hit, d_world));
    return is_of_sphere(hit) ? light : light + emission_of_hit(hit);
}

// A thing before a wall is shown on it larger than it is, and in a wrong place: it is as much fainter there, and the rest is the
// wall.
vec4 radiance_along(vec3 d)
{
    vec3 begin = box_exit(work.position, d, work.low, work.high);
    vec3 origin = (frame.world_from_models * vec4(begin, 1.0)).xyz, d_world = mat3(frame.world_from_models) * d;
    RayHit hit = trace_ray(origin, d_world, 1e30, false);
    if (hit.t < 0.0)
        return vec4(0.0, 0.0, 0.0, luminance(hit.transmission));
    vec3 through = hit.transmission, light = through * given_back(hit, d_world);
    float wall = distance(work.position, box_exit(work.position, d, work.walls_low, work.walls_high)), t = hit.t;
    if (wall > NO_WALL)
        return vec4(light, 0.0);
    float share = min(t * t / (wall * wall), 1.0);
    for (uint i = 0u; i < MOST_HITS && t < BEFORE_WALL * wall; ++i) {
        float from = t * (1.0 + 1e-4) + 1e-5 * wall;
        hit = trace_ray(origin + from * d_world, d_world, 1e30, false);
        t = hit.t < 0.0 ? 1e30 : from + hit.t;
        through *= hit.transmission;
        // Otherwise what was met first may be the wall of a room that is no box.
        if (t >= BEFORE_WALL * wall && t < BEYOND_WALL * wall && !is_back(hit, d_world))
            light = mix(through * given_back(hit, d_world), light, share);
    }
    return vec4(light, 0.0);
}

void main()
{
    uvec2 size = uvec2(imageSize(capture).xy), texel = gl_GlobalInvocationID.xy + uvec2(0u, work.first_row);
    if (texel.x >= size.x || texel.y >= min(size.y, work.first_row + work.rows))
        return;
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < RAYS * RAYS; ++i) {
        vec2 part = (vec2(i % RAYS, i / RAYS) + 0.5) / float(RAYS);
        sum += radiance_along(panorama_direction((vec2(texel) + part) / vec2(size)));
    }
    vec4 seen = sum / float(RAYS * RAYS);
    imageStore(capture, ivec3(texel, 0), vec4(min(seen.rgb, HALF_MOST), seen.a));
}
