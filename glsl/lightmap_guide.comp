// What the filter of a lightmap goes by: each texel's irradiance beside that of its nearest, and the variance of its noise.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap_beside.glsl"

const int REACH = 2; // texels

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    ivec3 at = texel_address(lightmap_texels[index]);
    LightmapSurface s = lightmap_surfaces[index];
    vec4 guide = vec4(0.0);
    vec2 variance = vec2(0.0);
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            uint beside = texel_at(at + ivec3(x, y, 0));
            if (beside == NO_TEXEL)
                continue;
            vec2 off = vec2(x, y);
            float alike = same_surface(s, lightmap_surfaces[beside], off);
            LightmapSums sums = lightmap_sums[beside];
            // The means of two halves of the samples differ by twice the error of the mean of all.
            float difference = sums.uneven / sums.all.a;
            guide += alike * exp2(-dot(off, off)) * vec4(sums.all.rgb / sums.all.a, 1.0);
            variance += alike * vec2(difference * difference, 1.0);
        }
    }
    lightmap_sums[index].kept = vec4(guide.rgb / max(guide.a, TINY), variance.x / max(variance.y, TINY));
}
