// What brdf.glsl computes, for src/precompute/brdf_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "brdf.glsl"

struct Input {
    vec3 n, v, l, h, base_color;
    float metallic;
    vec4 dielectric; // F0 and F90
    float roughness, alpha, nl, nv, vh;
};
struct Output {
    float alpha, d, stretched_d, stretched_smith, smith, karis, karis_direct, karis_ibl, direct[2], environment[2], weight, exponent, phong, widened, slanted;
    vec3 schlick, schlick_roughness, lambert, thesis;
    vec4 fresnel;
    vec3 specular[2];
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
    Output o;
    o.alpha = alpha_from_roughness(i.roughness);
    o.d = d_ggx(i.n, i.h, i.alpha);
    vec2 alphas = stretched_alphas(i.alpha, i.metallic);
    o.stretched_d = d_ggx_stretched(i.h, alphas);
    o.stretched_smith = v_smith_stretched(i.l, i.v, alphas);
    o.smith = v_smith_height_correlated(i.nl, i.nv, i.alpha);
    o.karis = v_karis2013(i.nl, i.nv, i.alpha);
    o.karis_direct = v_karis2013_direct(i.nl, i.nv, i.roughness);
    o.karis_ibl = v_karis2013_ibl(i.nl, i.nv, i.roughness);
    o.weight = schlick_weight(i.vh);
    o.exponent = phong_exponent(i.roughness);
    o.phong = phong_specular(i.n, i.v, i.l, i.roughness);
    o.widened = widened_roughness(i.roughness, i.metallic); // any number from 0 to 1
    o.slanted = slanted_coverage(i.metallic, i.vh);
    Fresnel f = fresnel_from_metallic(i.base_color, i.metallic, bare_fresnel(i.dielectric.rgb, i.dielectric.a));
    o.fresnel = vec4(f.f0, f.f90);
    o.schlick = f_schlick(f, i.vh);
    o.schlick_roughness = f_schlick_roughness(i.base_color, i.nv, i.roughness);
    o.lambert = diffuse_lambert(i.base_color);
    o.thesis = diffuse_karis2013(i.base_color, f, i.vh);
    for (int geometry = 0; geometry < 2; ++geometry) {
        o.direct[geometry] = v_direct(i.nl, i.nv, i.roughness, geometry);
        o.environment[geometry] = v_environment(i.nl, i.nv, i.roughness, geometry);
        o.specular[geometry] = specular(i.n, i.v, i.l, f, i.roughness, geometry);
    }
    outputs[id] = o;
}
