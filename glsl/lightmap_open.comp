// Until soft light is known, that of an open sky, all of which is seen.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    LightmapTexel texel = lightmap_texels[work.first + gl_GlobalInvocationID.x];
    PathPoint p = texel_point(texel_hit(texel, vec2(0.5)), (texel.triangle & LIGHTMAP_BACK) != 0u);
    vec3 light = textureLod(irradiance_over_pi, panorama_from_world(p.s.n), 0.0).rgb * (PI * frame.environment_scale);
    ivec3 at = texel_address(texel);
    imageStore(direct_image, at, vec4(0.0));
    imageStore(soft_image, at, vec4(0.0));
    imageStore(light_image, at, vec4(min(light, HALF_MOST), 1.0));
    imageStore(light_image, kind_address(LIGHTMAP_OPENNESS, at), vec4(2.0 / 3.0 * (p.s.n * mat3(frame.world_from_models)), 1.0));
}
