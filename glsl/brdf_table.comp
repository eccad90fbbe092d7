// The split sum's table: for each n.v and roughness the lobe BRDF · n.l over the light's directions, in two parts, weighted
// with Schlick's (1 - v.h)^5 (B) and with the rest of 1 (A): Karis (2013), eq. 8. Layer 0: A, B, and of each part's mean
// vector the square root of `along`; layer 1: `across` / sin (environment.glsl), and A and B averaged over directions,
// 2 ∫ A n.v d(n.v), the same all along a row (energy.glsl). Twins: reference::table, reference::energy.
//
// The integral is ∫ V · 4 nl · vh / nh · D nh dh over half vectors h = (θ, φ) (Walter et al. 2007, eqs. 14 and 35), where
// tan θ = α tan s turns D nh dh into 2 sin s cos s ds dφ / 2π. l is above the surface exactly for θ < (ψ + π/2) / 2 with
// tan ψ = tan θv cos φ. So the integrand is smooth inside, and Gauss's rule over φ and s good to 1e-4, its nodes over s
// crowded at the horizon, where V turns sharply.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "brdf.glsl"
#include "table.glsl"

const int PHI_NODES = 8;
const int S_NODES = 16;
// Below it a surface is a mirror: what its masking takes lies nearer to the horizon than the second texel.
const float SMALLEST_ALPHA = 2e-6;

const uint ROW = 128; // texels along n.v

// One group a row, so that its mean is known to all.
layout(local_size_x = ROW) in;
layout(constant_id = 0) const int GEOMETRY = 0;
layout(constant_id = 1) const bool CLASSIC = false; // along r, by the roughness's own lobe
layout(set = 0, binding = 0, scalar) readonly buffer Nodes {
    vec2 phi_nodes[PHI_NODES]; // in (0, 1), and weights that add up to 1
    vec2 s_nodes[S_NODES];
};
layout(set = 0, binding = 1, scalar) readonly buffer Spreads { float kernel_spreads[]; }; // by row
layout(set = 0, binding = 2, scalar) readonly buffer MeanWeights { float mean_weights[ROW]; }; // by column
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2DArray table;

shared vec2 row_weights[ROW];

// Both parts: their integrals, and those of 1 - l.r and l.t.
struct Parts {
    vec2 weight;
    vec2 along;
    vec2 across;
};

void add_quarter(float quarter, float nv, float sv, float roughness, float alpha, inout Parts parts)
{
    for (int i = 0; i < PHI_NODES; ++i) {
        float cos_phi = cos((quarter + phi_nodes[i].x) * 0.5 * PI);
        float theta_max = 0.5 * (atan(sv * cos_phi, nv) + 0.5 * PI);
        float s_max = atan(sin(theta_max), alpha * cos(theta_max));
        for (int j = 0; j < S_NODES; ++j) {
            float s = s_nodes[j].x * s_max;
            float sin_s = sin(s), cos_s = cos(s);
            float over = inversesqrt(alpha * alpha * sin_s * sin_s + cos_s * cos_s);
            float nh = cos_s * over;
            vec2 h = vec2(alpha * sin_s * over * cos_phi, nh); // in the plane of incidence
            float vh = max(dot(vec2(sv, nv), h), 0.0);
            float nl = max(2.0 * vh * nh - nv, MIN_COS);
            // cos s / nh = 1 / over; φ and −φ are alike.
            float density = phi_nodes[i].y * s_nodes[j].y * s_max * sin_s / over;
            float value = density * 4.0 * nl * vh * v_environment(nl, nv, roughness, GEOMETRY);
            float f = schlick_weight(vh);
            vec2 weight = value * vec2(1.0 - f, f);
            parts.weight += weight;
            // (l - r) / 2 = (v.h) h - (n.v) n in the plane of incidence, where t = (nv, sv).
            float sin2 = alpha * alpha * sin_s * sin_s * over * over;
            vec2 turn = vec2(vh * h.x, sv * h.x * nh - nv * sin2);
            float along = 2.0 * (vh * vh * sin2 + turn.y * turn.y), across = 2.0 * (nv * turn.x + sv * turn.y);
            parts.along += weight * along;
            parts.across += weight * across;
        }
    }
}

void main()
{
    uvec2 id = gl_GlobalInvocationID.xy, size = uvec2(imageSize(table).xy);
    vec2 arguments = table_arguments(id, size);
    // At n.v = 1 there is no plane of incidence; across / sin has a limit.
    float nv = clamp(arguments.x, MIN_COS, 0.99999), roughness = arguments.y;
    float sv = sqrt(1.0 - nv * nv);
    float alpha = roughness * roughness;
    Parts parts = Parts(vec2(0.0), vec2(0.0), vec2(0.0));
    if (alpha < SMALLEST_ALPHA) {
        float f = schlick_weight(nv);
        parts.weight = vec2(1.0 - f, f);
    } else {
        add_quarter(0.0, nv, sv, roughness, alpha, parts);
        add_quarter(1.0, nv, sv, roughness, alpha, parts);
    }
    row_weights[id.x] = parts.weight * mean_weights[id.x];
    barrier();
    vec2 mean = vec2(0.0);
    for (uint i = 0u; i < ROW; ++i)
        mean += row_weights[i];
    if (CLASSIC) {
        imageStore(table, ivec3(id, 0), vec4(parts.weight, sqrt(vec2(kernel_spreads[id.y]))));
        imageStore(table, ivec3(id, 1), vec4(vec2(0.0), mean));
        return;
    }
    vec2 over = 1.0 / max(parts.weight, vec2(TINY)), along = parts.along * over, across = parts.across * over;
    imageStore(table, ivec3(id, 0), vec4(parts.weight, sqrt(along)));
    imageStore(table, ivec3(id, 1), vec4(across / sv, mean));
}
