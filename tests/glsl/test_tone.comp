// What tone.glsl computes, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "tone.glsl"

struct Input {
    vec3 rgb;
    float ev;
};
struct Output {
    float scale, luminance;
    vec3 neutral, encoded, decoded;
};
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= inputs.length())
        return;
    vec3 rgb = inputs[id].rgb;
    vec3 display = clamp(rgb, 0.0, 1.0);
    outputs[id] = Output(exposure_scale(inputs[id].ev), luminance(rgb), tone_neutral(rgb), srgb_encode(display),
                         srgb_decode(display));
}
