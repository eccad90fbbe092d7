// Takes the mean of all samples so far: what texels give back of it, and where it is shown the lightmap itself, which of
// bounces is the mean over those that are kept.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    ivec3 at = texel_address(lightmap_texels[index]);
    vec4 sum = lightmap_sums[index].all, known = sum;
    if ((work.flags & WORK_KEEPS) != 0u) {
        known += lightmap_sums[index].kept;
        lightmap_sums[index].kept = known;
    }
    bool is_shown = (work.flags & WORK_IS_SHOWN) != 0u;
    vec3 shown = is_shown ? max(mean_irradiance(known), 0.0) : imageLoad(light_image, at).rgb;
    imageStore(light_image, at, vec4(shown, sum.a > 0.0 ? 1.0 : 0.0));
    if (is_shown)
        store_directions(at, lightmap_surfaces[index], shown);
    store_soft(at, lightmap_surfaces[index], irradiance_to_give(lightmap_sums[index]));
}
