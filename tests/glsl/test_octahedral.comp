// What octahedral.glsl computes, for src/render/scene_resources/vertex.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "octahedral.glsl"

struct Output {
    vec3 normal;
    vec4 tangent;
};
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { vec4 inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id < inputs.length())
        outputs[id] = Output(frame_normal(inputs[id]), frame_tangent(inputs[id]));
}
