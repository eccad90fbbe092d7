// The split sum's table: x = n·v, y = roughness, at texel centres; R scales F0, G is added to it. Karis (2013), eq. 8;
// the sum runs over half vectors that v sees (sample_vndf).
// Twin: reference::integrals::brdf_table_entry.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "brdf.glsl"
#include "sampling.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const int GEOMETRY = 0;
layout(constant_id = 1) const uint LOG2_SAMPLES = 10;
layout(set = 0, binding = 0, rgba16f) uniform writeonly image2DArray table;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uvec2 size = uvec2(imageSize(table).xy);
    if (any(greaterThanEqual(id.xy, size)))
        return;
    vec2 at = (vec2(id.xy) + 0.5) / vec2(size);
    float nv = at.x, roughness = at.y;
    float alpha = roughness * roughness, a2 = alpha * alpha;
    vec3 v = vec3(sqrt(1.0 - nv * nv), 0.0, nv);
    float towards_v = nv + sqrt(a2 + (1.0 - a2) * nv * nv);
    float middle = 0.5 / float(1u << LOG2_SAMPLES); // of the strip that each point stands for
    vec2 sum = vec2(0.0);
    for (uint i = 0u; i < (1u << LOG2_SAMPLES); ++i) {
        vec3 h = sample_vndf(v, hammersley(i, LOG2_SAMPLES) + middle, alpha);
        float vh = max(dot(v, h), 0.0);
        float nl = 2.0 * vh * h.z - nv;
        if (nl <= 0.0)
            continue;
        float visibility = GEOMETRY == GEOMETRY_KARIS2013 ? v_karis2013_ibl(nl, nv, roughness)
                                                          : v_smith_height_correlated(nl, nv, alpha);
        // D V nl over the density of l, in which D cancels.
        float weight = 2.0 * visibility * nl * towards_v;
        float f = schlick_weight(vh);
        sum += weight * vec2(1.0 - f, f);
    }
    imageStore(table, ivec3(id.xy, 0), vec4(round_to_half(vec3(sum / float(1u << LOG2_SAMPLES), 0.0)), 0.0));
}
