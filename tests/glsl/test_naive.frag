// The light of point lights as tutorials write it, with their guards: cosines of at least 0, and 0.0001 more in the
// denominator. src/render/random_gpu_tests.rs shows that it fails.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "math.glsl"
#include "surface.glsl"

layout(location = 0) out vec4 colour;

void cut_out(float above) {}

// Schlick's G1 with Karis's k for point lights.
float masking(float cosine, float roughness)
{
    float k = (roughness + 1.0) * (roughness + 1.0) / 8.0;
    return cosine / (cosine * (1.0 - k) + k);
}

void main()
{
    vec3 albedo = base_color_metallic.rgb * texture(base_color_map, uv).rgb;
    vec3 maps = texture(orm_map, uv).rgb;
    float roughness = maps.g * surface_factors.x, metallic = maps.b * base_color_metallic.a;
    vec3 m = 2.0 * texture(normal_map, uv).xyz - 1.0;
    vec3 normal = normalize(normal_world), tangent = normalize(tangent_world.xyz);
    vec3 n = normalize(mat3(tangent, tangent_world.w * cross(normal, tangent), normal) * m);
    vec3 v = normalize(frame.eyes[eye].world_from_view[3].xyz - position_world);
    vec3 f0 = mix(vec3(0.04), albedo, metallic), sum = vec3(0.0);
    for (uint i = 0u; i < frame.light_count; ++i) {
        vec3 l = normalize(lights[i].position - position_world), h = normalize(v + l);
        float away = length(lights[i].position - position_world);
        float nl = max(dot(n, l), 0.0), nv = max(dot(n, v), 0.0), nh = max(dot(n, h), 0.0);
        float a2 = roughness * roughness * roughness * roughness, q = nh * nh * (a2 - 1.0) + 1.0;
        float d = a2 / (PI * q * q), g = masking(nl, roughness) * masking(nv, roughness);
        vec3 f = f0 + (1.0 - f0) * pow(1.0 - max(dot(h, v), 0.0), 5.0);
        vec3 reflected = (1.0 - f) * (1.0 - metallic) * albedo / PI + d * g * f / (4.0 * nv * nl + 0.0001);
        sum += reflected * lights[i].intensity / (away * away) * nl;
    }
    colour = vec4(sum, 1.0);
}
