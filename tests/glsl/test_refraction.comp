// What refraction.glsl computes, for src/precompute/refraction_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "refraction.glsl"

struct Input {
    vec3 v, h;
    vec3 n;
    float alpha, eta, which, ior;
};
struct Output {
    float fresnel;
    vec3 l;
    float transmitted, weight;
    vec3 inside;
    float chord;
    vec3 through;
    float variance, spread2;
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
    Crossing c = cross_boundary(i.v, i.h, i.alpha, i.eta, i.which);
    BallPath path = ball_path(i.n, i.v, i.ior);
    outputs[id] = Output(fresnel_dielectric(max(dot(i.v, i.h), 0.0), i.eta), c.l, float(c.transmitted), c.weight, path.inside,
        path.chord, path.l, ball_variance(i.ior), ball_spread2(max(dot(i.n, i.v), 0.0), i.ior));
}
