// Runs shadow_place.glsl over a list of inputs, for src/render/shadow_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shadow_place.glsl"

struct Input { vec3 q; vec3 n; float near; float radius; float texels; vec3 sizes; };
struct Output { vec2 uv; float layer; float depth; vec2 slope; vec2 spread; float sun_depth; vec2 sun_slope; vec2 sun_uv; vec2 sun_back; };

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= inputs.length())
        return;
    Input x = inputs[i];
    ShadowPlace place = lamp_place(x.q, x.n, x.near, x.radius, x.texels);
    ShadowPlace sun = sun_place(x.q, x.n * x.sizes, x.sizes * x.sizes, vec2(x.radius), x.texels);
    outputs[i] = Output(place.uv, place.layer, place.depth, place.slope, place.spread, sun.depth, sun.slope, sun.uv, sun.back);
}
