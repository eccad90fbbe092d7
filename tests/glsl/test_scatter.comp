// What scatter.glsl computes, for src/render/scatter_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scatter.glsl"

struct Input {
    vec3 v, l, base_color;
    float metallic;
    vec4 dielectric; // F0 and F90
    vec3 film;       // share, index of refraction, thickness
    float roughness, clearcoat, clearcoat_roughness;
    vec3 clearcoat_n, sheen;
    float sheen_roughness, stretch;
    uvec4 bits;
};
struct Output {
    vec3 value;         // for l
    float density;      // of l
    vec3 l;             // the sample
    uint mirrored;
    vec3 sample_value;
    float sample_density;
    float share;
};
layout(local_size_x = 64) in;
layout(set = 2, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 2, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= inputs.length())
        return;
    Input i = inputs[id];
    Surface s;
    s.base_color = i.base_color;
    s.metallic = i.metallic;
    s.dielectric = bare_fresnel(i.dielectric.rgb, i.dielectric.a);
    s.dielectric.film = Film(i.film.x, i.film.y, i.film.z, i.dielectric.rgb);
    s.roughness = i.roughness;
    s.clearcoat = i.clearcoat;
    s.clearcoat_roughness = i.clearcoat_roughness;
    s.clearcoat_n = i.clearcoat_n;
    s.sheen = i.sheen;
    s.sheen_roughness = i.sheen_roughness;
    s.occlusion = 1.0;
    s.n = vec3(0.0, 0.0, 1.0);
    s.v = i.v;
    s.nv = i.v.z;
    s = i.stretch > 0.0 ? stretched(s, vec3(0.8, 0.6, 0.0), i.stretch) : unstretched(s);
    mat3 world_from_surface = surface_basis(s);
    Scatter m = make_scatter(s, world_from_surface);
    Output o;
    o.value = scattered(m, i.l * world_from_surface);
    o.density = scatter_density(m, i.l * world_from_surface);
    bool mirrored;
    vec3 l = sample_scatter(m, i.bits, mirrored);
    o.l = world_from_surface * l;
    o.mirrored = mirrored ? 1u : 0u;
    vec3 above = vec3(l.xy, max(l.z, 1e-6));
    o.sample_value = scattered(m, above);
    o.sample_density = scatter_density(m, above);
    o.share = m.specular_share;
    outputs[id] = o;
}
