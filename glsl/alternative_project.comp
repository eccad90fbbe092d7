// Light as spherical harmonics: workgroup i computes the coefficient ∫ L Y_lm dω of i = l(l + 1) + m as a sum over all
// texels of one mip of the environment with their solid angles, times what the clamped cosine over pi makes of degree l
// (Ramamoorthi and Hanrahan 2001, eqs. 7 and 8).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"
#include "harmonics.glsl"

layout(local_size_x = 128) in;
layout(set = 0, binding = 0, rgba16f) uniform readonly image2DArray environment;
layout(set = 0, binding = 1) writeonly buffer Coefficients { vec4 coefficients[]; };

shared vec3 parts[gl_WorkGroupSize.x];

void main()
{
    uint own = gl_LocalInvocationID.x;
    int i = int(gl_WorkGroupID.x);
    int l = int(sqrt(float(i) + 0.5));
    int m = i - l * (l + 1);
    uint size = uint(imageSize(environment).x);
    vec3 sum = vec3(0.0);
    for (uint t = own; t < 6u * size * size; t += gl_WorkGroupSize.x) {
        uvec3 texel = uvec3(t % size, t / size % size, t / (size * size));
        vec3 d = cube_direction(texel.z, (vec2(texel.xy) + 0.5) / float(size));
        float w = cube_texel_solid_angle(texel.xy, size) * harmonic(l, m, d);
        sum += w * imageLoad(environment, ivec3(texel)).rgb;
    }
    // Pairs in a fixed order, so that every run gives the same bits.
    parts[own] = sum;
    for (uint half_count = gl_WorkGroupSize.x / 2u; half_count > 0u; half_count /= 2u) {
        barrier();
        if (own < half_count)
            parts[own] += parts[own + half_count];
    }
    if (own == 0u)
        coefficients[i] = vec4(cosine_lobe(l) * parts[0], 0.0);
}
