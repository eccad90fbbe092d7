// Panorama to mip 0 of a cube map and to specular level 0: each texel is the mean over TAPS² points of it, weighted by
// solid angle.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const uint TAPS = 4;
layout(set = 0, binding = 0) uniform sampler2D panorama;
layout(set = 0, binding = 1, rgba32f) uniform writeonly image2DArray cube;
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2DArray level;
layout(push_constant) uniform Push { float inverse_scale; } push;

// Mean radiance along the parallel through d, over an arc as long as the taps lie apart. Close to the poles, where such an
// arc spans many texels, no texel is missed; elsewhere it is one look-up.
vec3 arc_mean(vec3 d, float arc_radians)
{
    vec2 uv = panorama_uv(d);
    float arc = min(arc_radians / (2.0 * PI * max(length(d.xz), MIN_COS)), 1.0); // of the whole parallel
    float width = float(textureSize(panorama, 0).x);
    float points = arc * width > 1.0 ? ceil(2.0 * arc * width) : 1.0;
    vec3 sum = vec3(0.0);
    for (float i = 0.5; i < points; ++i)
        sum += textureLod(panorama, vec2(uv.x + arc * (i / points - 0.5), uv.y), 0.0).rgb;
    return sum / points;
}

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
            float arc_radians = 2.0 * sqrt(w) / float(size * TAPS);
            sum += w * vec4(arc_mean(cube_direction(id.z, st), arc_radians), 1.0);
        }
    }
    vec3 radiance = sum.rgb / sum.a * push.inverse_scale;
    imageStore(cube, ivec3(id), vec4(radiance, 1.0));
    imageStore(level, ivec3(id), vec4(round_to_half(radiance), 1.0));
}
