// Takes the coarse noise out of a lightmap that its filter leaves: the mean of texels a few apart. A step of an à-trous filter:
// Dammertz, Sewtz, Hanika and Lensch, "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering" (2010).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap_beside.glsl"

const int STEP = 4; // texels
// See `alike`; what is left of noise is more than the filter's weights say, as they follow it.
const float RANGE = 2.5;

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    ivec3 at = texel_address(lightmap_texels[index]);
    LightmapSurface s = lightmap_surfaces[index];
    if (lightmap_sums[index].all.a == 0.0)
        return;
    vec4 filtered = lightmap_sums[index].filtered, light = vec4(0.0);
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            uint beside = texel_at(at + STEP * ivec3(x, y, 0));
            if (beside == NO_TEXEL)
                continue;
            vec2 off = vec2(x, y);
            vec4 other = lightmap_sums[beside].filtered;
            float weight = same_surface(s, lightmap_surfaces[beside], float(STEP) * off) * alike(filtered, other, RANGE);
            light += weight * exp2(-0.25 * dot(off, off)) * vec4(other.rgb, 1.0);
        }
    }
    imageStore(light_image, at, vec4(mean_irradiance(light), 1.0));
}
