// What openness.glsl computes, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "openness.glsl"

struct Input {
    vec3 n, mean, d;
    float spread, cosine, over_pi, open_over_pi;
};
struct Output {
    float visibility, most_radiance, image_bound;
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
    // Of an image of 1.
    vec3 bound = image_bound(vec3(1.0), vec3(i.over_pi), vec3(i.open_over_pi), 1.0);
    outputs[id] = Output(visibility(openness_from_mean(i.n, i.mean), i.d), most_radiance(i.spread, i.cosine), bound.x);
}
