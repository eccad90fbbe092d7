// What sampling.glsl computes, for src/precompute/brdf_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "sampling.glsl"

struct Input {
    vec3 n, v, h;
    vec2 u;
    float alpha;
    vec2 alphas;
    uint index, log2_count;
};
struct Output {
    float unit, inverse;
    vec2 point;
    vec3 tangent, bitangent, normal, ggx, vndf;
    float pdf_ggx, pdf_vndf;
    vec2 sobol;
    vec3 sphere, cosine;
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
    mat3 axes = basis(i.n);
    outputs[id] = Output(unit_from_bits(i.index), radical_inverse(i.index), hammersley(i.index, i.log2_count), axes[0],
                         axes[1], axes[2], sample_ggx(i.u, i.alpha), sample_vndf(i.v, i.u, i.alphas),
                         pdf_ggx(i.v, i.h, i.alpha), pdf_vndf(i.v, i.h, i.alphas),
                         sobol(i.index, uvec2(i.log2_count, ~i.index)), sphere_direction(i.u), cosine_direction(i.u));
}
