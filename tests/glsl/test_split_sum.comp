// What split_sum.glsl computes, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "split_sum.glsl"

struct Input {
    float along, lean, nv, sin2, roughness, variance;
};
struct Output {
    float even;
    vec2 towards;
    float spread;
    vec2 apart;
    float each_spread, turned_spread;
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
    Match found = match_lobe(i.along * even_over_along(i.nv, i.roughness), i.along, i.lean, i.nv, i.sin2);
    Pair pair = split_lobe(found, apart_over_sin2(i.roughness), i.sin2);
    outputs[id] = Output(found.even, found.towards, found.spread, pair.apart, pair.spread,
                         turned_spread(found.spread, i.nv, i.variance));
}
