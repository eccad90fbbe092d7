// How much of the sky's light texels see, as those around them on the same surface have found as well: few samples of one texel
// find a small window.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap_beside.glsl"

const int REACH = 4; // texels

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    ivec3 at = texel_address(lightmap_texels[index]);
    LightmapSurface s = lightmap_surfaces[index];
    vec2 sky = vec2(0.0);
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            uint beside = texel_at(at + ivec3(x, y, 0));
            if (beside != NO_TEXEL)
                sky += same_surface(s, lightmap_surfaces[beside], vec2(x, y)) * lightmap_sums[beside].sky;
        }
    }
    // No more bounces are kept.
    lightmap_sums[index].kept = vec4(sky, 0.0, 0.0);
}
