// Irradiance over pi for each direction n of a cube map from coefficients of spherical harmonics up to degree ORDER that
// already hold the clamped cosine: Σ c_lm Y_lm(n) (Ramamoorthi and Hanrahan 2001, eq. 9).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"
#include "harmonics.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const int ORDER = 2;
layout(set = 0, binding = 0) readonly buffer Coefficients { vec4 coefficients[]; };
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray irradiance_over_pi;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(irradiance_over_pi).x);
    if (id.x >= size || id.y >= size)
        return;
    vec3 n = cube_direction(id.z, (vec2(id.xy) + 0.5) / float(size));
    vec3 sum = vec3(0.0);
    for (int l = 0; l <= ORDER; ++l) {
        for (int m = -l; m <= l; ++m)
            sum += coefficients[l * (l + 1) + m].rgb * harmonic(l, m, n);
    }
    imageStore(irradiance_over_pi, ivec3(id), vec4(sum, 1.0));
}
