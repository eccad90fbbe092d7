// What math.glsl computes, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "math.glsl"

struct Input {
    vec3 v, otherwise;
};
struct Output {
    vec3 unit, half_float;
};
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= inputs.length())
        return;
    outputs[id].unit = normalize_or(inputs[id].v, inputs[id].otherwise);
    outputs[id].half_float = round_to_half(abs(inputs[id].v));
}
