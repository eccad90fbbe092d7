// Takes the mean of all samples so far: what texels give back of it, and where it is shown the lightmap itself, which of
// bounces is the mean over those that are kept.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

// Of sums of irradiance and their number.
vec3 mean(vec4 sum)
{
    return sum.a > 0.0 ? clamp(sum.rgb / sum.a, 0.0, HALF_MOST) : vec3(0.0);
}

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    ivec3 at = texel_address(lightmap_texels[index]);
    vec4 sum = lightmap_sums[index], known = sum;
    if ((work.flags & WORK_KEEPS) != 0u) {
        known += lightmap_surfaces[index].kept;
        lightmap_surfaces[index].kept = known;
    }
    vec3 light = mean(sum), shown = (work.flags & WORK_IS_SHOWN) != 0u ? mean(known) : imageLoad(light_image, at).rgb;
    imageStore(light_image, at, vec4(shown, sum.a > 0.0 ? 1.0 : 0.0));
    if ((work.flags & WORK_IS_SHOWN) != 0u) {
        imageStore(light_image, kind_address(LIGHTMAP_OPENNESS, at), openness_texel(lightmap_surfaces[index]));
        imageStore(light_image, kind_address(LIGHTMAP_BLOCKERS, at), blockers_texel(lightmap_surfaces[index], shown));
    }
    vec4 albedo = lightmap_surfaces[index].albedo;
    imageStore(soft_image, at, vec4(albedo.rgb * light * INV_PI, albedo.a));
}
