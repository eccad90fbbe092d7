// How much of the light that surfaces give back is given back once more, over all texels: a pair of sums for each workgroup, in the
// place of its first texels' samples, which the next bounce does not need.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

shared vec2 sums[64];

void main()
{
    vec2 sum = vec2(0.0);
    for (uint i = gl_GlobalInvocationID.x; i < work.count; i += gl_NumWorkGroups.x * gl_WorkGroupSize.x) {
        vec3 given = imageLoad(soft_image, texel_address(lightmap_texels[i])).rgb;
        sum += vec2(dot(given, vec3(1.0)), dot(given, lightmap_surfaces[i].albedo.rgb));
    }
    sums[gl_LocalInvocationID.x] = sum;
    for (uint half_of = 32u; half_of > 0u; half_of >>= 1u) {
        barrier();
        if (gl_LocalInvocationID.x < half_of)
            sums[gl_LocalInvocationID.x] += sums[gl_LocalInvocationID.x + half_of];
    }
    if (gl_LocalInvocationID.x == 0u)
        lightmap_sums[gl_WorkGroupID.x].all = vec4(sums[0], 0.0, 0.0);
}
