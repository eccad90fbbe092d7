// One specular level: radiance averaged by the GGX lobe of one alpha for n = v = r (Karis 2013, section "Pre-Filtered
// Environment Map"), by filtered importance sampling: each sample reads the mip whose texels are as large as the solid
// angle it stands for (Křivánek and Colbert, "Real-time Shading with Filtered Importance Sampling", 2008, eq. 13).
// The samples are the same around every r, so the CPU makes them: precompute::lobe.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cube.glsl"
#include "sampling.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform samplerCube environment;
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray level;
// xyz: direction, +Z being r; w: mip.
layout(set = 0, binding = 2, scalar) readonly buffer Samples { vec4 samples[]; };

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(level).x);
    if (id.x >= size || id.y >= size)
        return;
    mat3 world_from_lobe = basis(cube_direction(id.z, (vec2(id.xy) + 0.5) / float(size)));
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < samples.length(); ++i) {
        vec4 l = samples[i];
        sum += l.z * vec4(textureLod(environment, world_from_lobe * l.xyz, l.w).rgb, 1.0);
    }
    imageStore(level, ivec3(id), vec4(round_to_half(sum.rgb / sum.a), 1.0));
}
