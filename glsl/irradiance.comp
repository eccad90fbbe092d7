// Irradiance over pi for each direction n of a cube map: (1/pi) ∫ L(l) max(n·l, 0) dl, as the sum over all texels of one
// mip of the environment. Twin: reference::integrals::irradiance.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2DArray environment;
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
        // On a face, l is (centre + p.x right + p.y down) / |...|, and n·l times the texel's solid angle falls as |...|^-4.
        vec3 centre = cube_direction(face, vec2(0.5));
        vec3 right = sqrt(2.0) * cube_direction(face, vec2(1.0, 0.5)) - centre;
        vec3 down = sqrt(2.0) * cube_direction(face, vec2(0.5, 1.0)) - centre;
        vec3 n_on_face = vec3(dot(n, right), dot(n, down), dot(n, centre));
        for (uint y = 0u; y < source; ++y) {
            for (uint x = 0u; x < source; ++x) {
                vec3 p = vec3((2.0 * vec2(x, y) + 1.0) / float(source) - 1.0, 1.0);
                float square = dot(p, p);
                float w = max(dot(n_on_face, p), 0.0) / (square * square);
                sum += w * vec4(imageLoad(environment, ivec3(x, y, face)).rgb, 1.0);
            }
        }
    }
    imageStore(irradiance_over_pi, ivec3(id), vec4(round_to_half(sum.rgb / sum.a), 1.0));
}
