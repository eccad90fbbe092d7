// What levels.glsl computes, for src/precompute/glsl_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "levels.glsl"

struct Input {
    float level, roughness, last_level;
};
struct Output {
    float alpha, level;
};
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= inputs.length())
        return;
    Input i = inputs[id];
    outputs[id] = Output(alpha_from_level(i.level, i.last_level), level_from_roughness(i.roughness, i.last_level));
}
