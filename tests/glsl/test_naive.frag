// The lamps' light as it is often written, without any guard: what src/render/random_tests.rs shows to fail.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "math.glsl"
#include "surface.glsl"

layout(location = 0) out vec4 colour;

void cut_out(float above) {}

void main()
{
    vec3 albedo = material.albedo * texture(albedo_map, uv).rgb;
    vec3 maps = texture(surface_map, uv).rgb;
    float roughness = maps.g * material.roughness, metallic = maps.b * material.metallic;
    vec3 m = 2.0 * texture(normal_map, uv).xyz - 1.0;
    mat3 frame_world = mat3(tangent_world.xyz, tangent_world.w * cross(normal_world, tangent_world.xyz), normal_world);
    vec3 n = normalize(frame_world * m);
    vec3 v = normalize(frame.eyes[eye].world_from_view[3].xyz - position_world);
    vec3 f0 = mix(vec3(0.04), albedo, metallic), sum = vec3(0.0);
    for (uint i = 0u; i < frame.light_count; ++i) {
        vec3 to_light = lights[i].position - position_world;
        vec3 l = normalize(to_light), h = normalize(v + l);
        float nl = max(dot(n, l), 0.0), nv = max(dot(n, v), 0.0), nh = dot(n, h), a2 = pow(roughness, 4.0);
        float q = nh * nh * (a2 - 1.0) + 1.0, k = roughness * roughness * 0.5;
        float d = a2 / (PI * q * q), g = nl / (nl * (1.0 - k) + k) * nv / (nv * (1.0 - k) + k);
        vec3 f = f0 + (1.0 - f0) * pow(1.0 - dot(v, h), 5.0);
        vec3 reflected = (1.0 - f) * (1.0 - metallic) * albedo / PI + f * (d * g / (4.0 * nl * nv));
        sum += reflected * lights[i].intensity / dot(to_light, to_light) * nl;
    }
    colour = vec4(sum, 1.0);
}
