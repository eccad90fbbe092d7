// Irradiance over pi for each direction n of a cube map: (1/pi) ∫ L(l) max(n·l, 0) dl, as the sum over all texels of one
// mip of the environment. Twin: reference::integrals::irradiance.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba16f) uniform readonly image2DArray environment;
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray irradiance_over_pi;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(irradiance_over_pi).x);
    uint source = uint(imageSize(environment).x);
    if (id.x >= size || id.y >= size)
        return;
    vec3 n = cube_direction(id.z, (vec2(id.xy) + 0.5) / float(size));
    // The weights' own sum replaces pi, so that a uniform environment comes out exactly.
    vec4 sum = vec4(0.0);
    for (uint face = 0u; face < 6u; ++face) {
        for (uint y = 0u; y < source; ++y) {
            for (uint x = 0u; x < source; ++x) {
                vec2 p = (2.0 * vec2(x, y) + 1.0) / float(source) - 1.0;
                float r = inversesqrt(1.0 + dot(p, p));
                vec3 l = cube_direction(face, 0.5 * p + 0.5);
                float w = max(dot(n, l), 0.0) * r * r * r;
                sum += w * vec4(imageLoad(environment, ivec3(x, y, face)).rgb, 1.0);
            }
        }
    }
    imageStore(irradiance_over_pi, ivec3(id), vec4(sum.rgb / sum.a, 1.0));
}
