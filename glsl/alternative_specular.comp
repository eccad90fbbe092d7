// One specular level by sampling, the usual way: ∫ L D n.l dl / ∫ D n.l dl for n = v = r (Karis 2013, section
// "Pre-Filtered Environment Map") as Σ L(l_i) n.l_i / Σ n.l_i over half vectors that GGX distributes (D n.h is their
// density, and with v = n that of l but for a constant). FILTERED: each sample reads the mip whose texels are as large as
// the solid angle it stands for (Křivánek and Colbert, "Real-time Shading with Filtered Importance Sampling", 2008,
// eq. 13, without the bias of 1 that they add by eye), and none falls below the horizon; else each is one tap of mip 0, as
// the thesis has it. Truth: reference::panorama_sums::prefiltered_around.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"
#include "sampling.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const uint LOG2_SAMPLES = 8;
layout(constant_id = 1) const bool FILTERED = true;
layout(set = 0, binding = 0) uniform samplerCube environment;
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray level;
layout(push_constant) uniform Push { float alpha; } push;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(level).x);
    if (id.x >= size || id.y >= size)
        return;
    vec3 n = cube_direction(id.z, (vec2(id.xy) + 0.5) / float(size));
    mat3 world_from_lobe = basis(n);
    float texels = 6.0 * float(textureSize(environment, 0).x) * float(textureSize(environment, 0).x);
    float samples = float(1u << LOG2_SAMPLES);
    // Light comes from above the horizon where tan^2 of h's angle is below 1: u.x < 1 / (1 + alpha^2) in sample_ggx.
    float within = 1.0 + push.alpha * push.alpha;
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < (1u << LOG2_SAMPLES); ++i) {
        vec2 u = hammersley(i, LOG2_SAMPLES);
        if (FILTERED)
            u.x /= within;
        vec3 h = sample_ggx(u, push.alpha);
        vec3 l = 2.0 * h.z * h - vec3(0.0, 0.0, 1.0); // v = n
        if (l.z <= 0.0)
            continue;
        float lod = 0.0;
        if (FILTERED) {
            float pdf = within * pdf_ggx(vec3(0.0, 0.0, 1.0), h, push.alpha);
            lod = max(0.5 * log2(texels / (4.0 * PI * samples * pdf)), 0.0);
        }
        sum += l.z * vec4(textureLod(environment, world_from_lobe * l, lod).rgb, 1.0);
    }
    imageStore(level, ivec3(id), vec4(sum.rgb / sum.a, 1.0));
}
