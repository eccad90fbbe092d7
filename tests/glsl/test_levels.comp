// What levels.glsl, lobe.glsl and table.glsl compute, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "levels.glsl"
#include "lobe.glsl"
#include "table.glsl"

struct Input {
    float spread; // of level_from_spread; the cosine and the spread of lobe_mean and grazing_mean are its 2 s - 1 and s / 100
    float alpha;
};
struct Output {
    float level, mean, grazing;
    vec2 coordinate;
    vec2 arguments;
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
    Lobe lobe = Lobe(i.alpha * i.alpha, 0.5 * (1.0 - i.alpha * i.alpha));
    float c = 2.0 * i.spread - 1.0;
    float mean = dot(lobe_mean(lobe, c, i.spread / 100.0), vec2(1.0, c)); // one colour: its mean cosine is c
    outputs[id] = Output(level_from_spread(i.spread), mean, grazing_mean(c, i.spread / 100.0),
        table_coordinate(i.spread, i.alpha, vec2(128.0, 96.0)),
        table_arguments(uvec2(id % 128u, id % 96u), uvec2(128u, 96u)));
}
