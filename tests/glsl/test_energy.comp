// What energy.glsl computes, for src/precompute/energy_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "energy.glsl"

struct Input {
    vec2 mean, at_l, at_v;
    vec3 base_color;
    float metallic;
    uint multiple;
    vec4 fresnel, dielectric; // F0 and F90
    float roughness, grazing; // of diffuse_taken and multiple_taken
};
struct Output {
    vec3 share, mixed, lobe, specular, diffuse, beyond, diffuse_even, multiple_even;
    float diffuse_taken, multiple_taken;
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
    Energy energy = Energy(i.mean, i.multiple != 0u, bare_fresnel(i.dielectric.rgb, i.dielectric.a));
    Fresnel f = bare_fresnel(i.fresnel.rgb, i.fresnel.a);
    Output o;
    o.share = multiple_share(energy, f);
    o.mixed = mixed_share(energy, i.base_color, i.metallic);
    o.lobe = multiple(energy, o.mixed, i.at_l, i.at_v);
    o.specular = specular_albedo(energy, f, i.at_v);
    o.diffuse = diffuse_kelemen2001(energy, i.base_color, i.at_l, i.at_v);
    o.beyond = beyond_single(energy, i.base_color, i.metallic, i.at_l, i.at_v);
    o.diffuse_even = diffuse_even(energy, i.base_color, i.metallic, i.at_v);
    o.multiple_even = multiple_even(energy, i.base_color, i.metallic, i.at_v);
    o.diffuse_taken = diffuse_taken(i.roughness, i.grazing);
    o.multiple_taken = multiple_taken(i.roughness, i.grazing);
    outputs[id] = o;
}
