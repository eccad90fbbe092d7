// What disc.glsl computes, for src/precompute/disc_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "disc.glsl"

struct Input {
    vec3 n, v, l, f0;
    float alpha, sine, exponent, angle, radius, pixel;
    vec2 u;
};
struct Output {
    float versine, cosine, ggx, phong, coverage, density_inside, density_outside;
    vec3 specular, direction, radiance;
};
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= inputs.length())
        return;
    Input m = inputs[i];
    Output o;
    o.versine = disc_versine(m.sine);
    o.cosine = disc_cosine(dot(m.n, m.l), m.sine);
    o.ggx = disc_ggx(m.n, m.v, m.l, max(m.alpha, DISC_MIN_ALPHA), m.sine);
    o.phong = disc_phong_exponent(m.exponent, m.sine);
    o.coverage = disc_coverage(m.angle, m.radius, m.pixel);
    o.specular = disc_specular(m.n, m.v, m.l, bare_fresnel(m.f0, 1.0), m.alpha, m.sine, GEOMETRY_SMITH);
    o.direction = sample_disc(m.u, m.l, m.sine);
    o.density_inside = disc_density(sample_disc(vec2(0.98 * m.u.x, m.u.y), m.l, m.sine), m.l, m.sine);
    o.density_outside = disc_density(basis(m.l) * vec3(1.1 * m.sine, 0.0, sqrt(1.0 - 1.21 * m.sine * m.sine)), m.l, m.sine);
    o.radiance = disc_radiance(m.f0, m.sine);
    outputs[i] = o;
}
