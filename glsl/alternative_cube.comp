// Panorama to mip 0 of the cube that the alternatives sample: each texel is the mean over TAPS² points of it, weighted by
// solid angle, as 1/ω ∫ L dω over the texel demands.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const uint TAPS = 4;
layout(set = 0, binding = 0) uniform sampler2D panorama;
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray cube;
layout(push_constant) uniform Push { float inverse_scale; } push;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(cube).x);
    if (id.x >= size || id.y >= size)
        return;
    vec4 sum = vec4(0.0);
    for (uint y = 0u; y < TAPS; ++y) {
        for (uint x = 0u; x < TAPS; ++x) {
            vec2 st = (vec2(id.xy) + (vec2(x, y) + 0.5) / float(TAPS)) / float(size);
            vec2 p = 2.0 * st - 1.0;
            // Solid angle per area on the cube's face: (1 + p²)^(-3/2).
            float w = inversesqrt(1.0 + dot(p, p));
            w = w * w * w;
            sum += w * vec4(textureLod(panorama, panorama_uv(cube_direction(id.z, st)), 0.0).rgb, 1.0);
        }
    }
    imageStore(cube, ivec3(id), vec4(sum.rgb / sum.a * push.inverse_scale, 1.0));
}
