// Panorama to cube map, and the finest nodes: an invocation reads TAPS^2 points in each of 2x2 texels of the cube, stores
// their means weighted by solid angle, and the light of all four as one node. WHITE: the nodes alone, of radiance 1. The alpha of
// the panorama is averaged as its light is.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"
#include "nodes.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const uint TAPS = 4;
layout(constant_id = 1) const bool WHITE = false;
layout(constant_id = 2) const bool ALPHA = false;
layout(set = 0, binding = 0) uniform sampler2D panorama;
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray cube;
layout(set = 0, binding = 2, scalar) writeonly buffer Nodes { Node nodes[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Alphas { vec4 alphas[]; };
layout(push_constant) uniform Push {
    float inverse_scale;
    uint first_layer; // of the image
} push;

// Mean radiance along the parallel through d, over an arc as long as the taps lie apart. Close to the poles, where such an
// arc spans many texels, no texel is missed; elsewhere it is one look-up.
vec4 arc_mean(vec3 d, float arc_radians)
{
    vec2 uv = panorama_uv(d);
    float arc = min(arc_radians / (2.0 * PI * max(length(d.xz), MIN_COS)), 1.0); // of the whole parallel
    float width = float(textureSize(panorama, 0).x);
    float points = arc * width > 1.0 ? ceil(2.0 * arc * width) : 1.0;
    vec4 sum = vec4(0.0);
    for (float i = 0.5; i < points; ++i)
        sum += textureLod(panorama, vec2(uv.x + arc * (i / points - 0.5), uv.y), 0.0);
    return sum / points;
}

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(cube).x);
    if (2u * id.x >= size || 2u * id.y >= size)
        return;
    vec3 flux = vec3(0.0);
    mat3 moment = mat3(0.0);
    vec4 alpha = vec4(0.0);
    for (uint i = 0u; i < 4u; ++i) {
        uvec2 texel = 2u * id.xy + uvec2(i & 1u, i >> 1);
        vec4 sum = vec4(0.0);
        float weight = 0.0;
        mat3 moments = mat3(0.0);
        vec3 alpha_moment = vec3(0.0);
        for (uint tap = 0u; tap < TAPS * TAPS; ++tap) {
            vec2 st = (vec2(texel) + (vec2(tap % TAPS, tap / TAPS) + 0.5) / float(TAPS)) / float(size);
            vec2 p = 2.0 * st - 1.0;
            // Solid angle per area on the cube's face: (1 + p^2)^(-3/2).
            float w = inversesqrt(1.0 + dot(p, p));
            w = w * w * w;
            vec3 direction = cube_direction(id.z, st);
            vec4 light = vec4(w);
            if (!WHITE)
                light *= vec4(vec3(push.inverse_scale), 1.0) * arc_mean(direction, 2.0 * sqrt(w) / float(size * TAPS));
            sum += light;
            weight += w;
            moments += outerProduct(direction, light.rgb);
            alpha_moment += direction * light.a;
        }
        if (!WHITE)
            imageStore(cube, ivec3(texel, push.first_layer + id.z), vec4(round_to_half(sum.rgb / weight), sum.a / weight));
        // The taps' weights add up to the texel's solid angle only nearly.
        float exact = cube_texel_solid_angle(texel, size) / weight;
        flux += exact * sum.rgb;
        moment += exact * moments;
        alpha += exact * vec4(alpha_moment, sum.a);
    }
    vec3 middle = cube_direction(id.z, (vec2(id.xy) + 0.5) * 2.0 / float(size));
    uint index = (id.z * (size / 2u) + id.y) * (size / 2u) + id.x;
    nodes[index] = make_node(flux, moment, middle);
    if (ALPHA)
        alphas[index] = alpha;
}
