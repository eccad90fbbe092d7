// What probe_box.glsl computes, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "probe_box.glsl"

struct Input {
    vec3 p, d, low, high;
    float border;
    float t;
};
struct Output {
    vec3 exit;
    float weight;
    uint is_in_image;
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
    Probe probe = Probe(vec3(0.0), i.low, i.high, i.low, i.high, i.border);
    bool is_in_image = is_in_image(i.p, normalize(i.d), i.t, probe);
    outputs[id] = Output(box_exit(i.p, i.d, i.low, i.high), probe_weight(i.p, probe), uint(is_in_image));
}
