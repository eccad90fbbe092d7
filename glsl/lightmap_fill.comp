// Gives texels that lie inside of things the light of those beside them; where it is shown in the lightmap itself, too.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

const int REACH = 3; // texels

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    ivec3 at = texel_address(lightmap_texels[index]);
    if (lightmap_sums[index].all.a > 0.0)
        return;
    ivec2 last = imageSize(light_image).xy - 1;
    vec4 sum = vec4(0.0), openness = vec4(0.0), blockers = vec4(0.0);
    vec3 soft_sum = vec3(0.0);
    // Only texels that are known are read, and only others are written.
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            ivec3 beside = ivec3(clamp(at.xy + ivec2(x, y), ivec2(0), last), at.z);
            vec4 light = imageLoad(light_image, beside);
            if (light.a > 0.0) {
                float weight = exp2(-float(x * x + y * y));
                soft_sum += imageLoad(soft_image, beside).rgb * weight;
                sum += vec4(light.rgb, 1.0) * weight;
                openness += imageLoad(light_image, kind_address(LIGHTMAP_OPENNESS, beside)) * weight;
                blockers += imageLoad(light_image, kind_address(LIGHTMAP_BLOCKERS, beside)) * weight;
            }
        }
    }
    if (sum.a > 0.0) {
        imageStore(soft_image, at, vec4(soft_sum / sum.a, lightmap_surfaces[index].albedo.a));
        if ((work.flags & WORK_IS_SHOWN) != 0u) {
            imageStore(light_image, at, vec4(sum.rgb / sum.a, 0.0));
            imageStore(light_image, kind_address(LIGHTMAP_OPENNESS, at), openness / sum.a);
            imageStore(light_image, kind_address(LIGHTMAP_BLOCKERS, at), blockers / sum.a);
        }
    }
}
