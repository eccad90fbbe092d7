// What the scene's point lights add to a surface: sums, not samples.
#ifndef LAMPS_GLSL
#define LAMPS_GLSL

#include "shared.glsl"
#include "brdf.glsl"
#include "surface.glsl"

// Irradiance of a point light on a surface that faces it, W/m^2, and its direction, a unit vector even in the lamp itself.
vec3 light_irradiance(PointLight light, out vec3 l)
{
    vec3 to_light = light.position - position_world;
    l = normalize_or(to_light, vec3(0.0, 1.0, 0.0));
    float squared = dot(to_light, to_light);
    return squared < 1e38 ? light.intensity / max(squared, 1e-8) : vec3(0.0); // too far, or NaN
}

vec3 point_lights(Surface s)
{
    vec3 sum = vec3(0.0);
    uint count = LIGHTS < 0 ? frame.light_count : uint(LIGHTS);
    for (uint i = 0u; i < count; ++i) {
        vec3 l;
        vec3 irradiance = light_irradiance(lights[i], l);
        float nl = dot(s.n, l);
        if (nl <= 0.0)
            continue;
        if (SHADING == SHADING_PHONG) {
            vec3 f0 = f0_from_metallic(s.albedo, s.metallic);
            sum += irradiance * nl * (diffuse_lambert(s.albedo) + f0 * phong_specular(s.n, s.v, l, s.roughness));
        } else {
            sum += irradiance * nl * brdf(s.n, s.v, l, s.albedo, s.metallic, s.roughness, GEOMETRY);
        }
    }
    return sum;
}

#endif
