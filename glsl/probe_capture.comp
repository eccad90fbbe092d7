// Light that comes to a probe from all sides, as a panorama in the models' space: what the lightmap's texels give back, and
// the panorama between them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "environment.glsl"
#include "ray_surface.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(PROBE_DIRECT) uniform sampler2DArray given_back_of_direct;
layout(PROBE_SOFT) uniform sampler2DArray given_back_of_soft;
layout(PROBE_CAPTURE, rgba32f) uniform writeonly image2DArray capture;
layout(push_constant, scalar) uniform Work {
    vec3 position; // in the models' space
    uint first_row;
    uint rows;
} work;

// Rays along each side of a texel.
const uint RAYS = 2;

vec3 sky(vec3 d, float texels_across)
{
    float lod = max(log2(float(textureSize(panorama, 0).x) / texels_across), 0.0);
    return textureLod(panorama, panorama_uv(panorama_from_world(mat3(frame.world_from_models) * d)), lod).rgb;
}

vec3 radiance_along(vec3 d, float rays_across)
{
    RayHit hit = bvh_trace(work.position, d, 1e30, false);
    if (hit.t < 0.0)
        return sky(d, rays_across);
    BvhTriangle triangle = bvh_triangles[hit.triangle];
    bool back = dot(cross(triangle.b - triangle.a, triangle.c - triangle.a), d) > 0.0;
    vec3 at = lightmap_address(hit, back);
    return textureLod(given_back_of_direct, at, 0.0).rgb + textureLod(given_back_of_soft, at, 0.0).rgb;
}

void main()
{
    uvec2 size = uvec2(imageSize(capture).xy), texel = gl_GlobalInvocationID.xy + uvec2(0u, work.first_row);
    if (texel.x >= size.x || texel.y >= min(size.y, work.first_row + work.rows))
        return;
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < RAYS * RAYS; ++i) {
        vec2 part = (vec2(i % RAYS, i / RAYS) + 0.5) / float(RAYS);
        sum += radiance_along(panorama_direction((vec2(texel) + part) / vec2(size)), float(RAYS * size.x));
    }
    imageStore(capture, ivec3(texel, 0), vec4(sum / float(RAYS * RAYS), 1.0));
}
