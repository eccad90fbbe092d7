// One mip of the cube that the alternatives sample, from the one before: four texels, weighted by exact solid angles.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba16f) uniform readonly image2DArray fine;
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray coarse;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(coarse).x);
    if (id.x >= size || id.y >= size)
        return;
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < 4u; ++i) {
        uvec2 texel = 2u * id.xy + uvec2(i & 1u, i >> 1);
        float w = cube_texel_solid_angle(texel, 2u * size);
        sum += w * vec4(imageLoad(fine, ivec3(texel, id.z)).rgb, 1.0);
    }
    imageStore(coarse, ivec3(id), vec4(sum.rgb / sum.a, 1.0));
}
