// What importance_chances.glsl computes, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "importance_chances.glsl"

struct Input {
    Tried tried;
    float chance;
};
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { vec2 outputs[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= inputs.length())
        return;
    Input i = inputs[id];
    outputs[id] = vec2(seen_share(i.tried), chance_of(0u, end_of(i.chance)));
}
