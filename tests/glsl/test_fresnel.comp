// What fresnel.glsl computes with a film, for src/precompute/fresnel_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "fresnel.glsl"

struct Input {
    vec3 base_color;
    float metallic;
    vec3 base_f0;
    float f90;
    vec3 film; // share, index of refraction, thickness
    float cosine;
};
struct Output {
    vec3 film, reflectance, seen;
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
    // F0 with a film is not read here.
    Fresnel dielectric = Fresnel(vec3(-1.0), i.f90, Film(i.film.x, i.film.y, i.film.z, i.base_f0));
    Fresnel f = fresnel_from_metallic(i.base_color, i.metallic, dielectric);
    Output o;
    o.film = film_reflectance(f.film, i.cosine);
    o.reflectance = reflectance(f, i.cosine);
    o.seen = f_schlick(seen_fresnel(f, i.cosine), i.cosine);
    outputs[id] = o;
}
