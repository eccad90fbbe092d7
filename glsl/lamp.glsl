// One lamp's light at a point, and the BRDF for it: for pictures and for paths.
#ifndef LAMP_GLSL
#define LAMP_GLSL

#include "shared.glsl"
#include "anisotropy.glsl"
#include "energy.glsl"
#include "shading_point.glsl"

uint lamp_count()
{
    return LIGHTS < 0 ? frame.light_count : uint(LIGHTS);
}

// A light of the scene, for a surface that is drawn.
PointLight scene_light(uint index)
{
    if (LIGHTS < 0)
        return lights[index];
    return counted_lights[index];
}

// Irradiance of a point light on a surface that faces it, W/m^2, and its direction, a unit vector even where the light itself is.
// Spot lights fall off as KHR_lights_punctual says.
vec3 light_irradiance(PointLight light, vec3 position, out vec3 l)
{
    vec3 to_light = light.position - position;
    l = normalize_or(to_light, vec3(0.0, 1.0, 0.0));
    float squared = dot(to_light, to_light);
    float inside = clamp(light.cone.x * dot(-l, light.along) + light.cone.y, 0.0, 1.0);
    return squared < 1e38 ? light.intensity * (inside * inside) / max(squared, max(light.radius * light.radius, 1e-8)) : vec3(0.0); // too far, or NaN
}

// Density per area of the points that light leaving a lamp evenly meets; `cosine` to the surface's normal.
float lamp_density(float cosine, float distance_metres)
{
    return max(cosine, 0.0) * 0.25 * INV_PI / max(distance_metres * distance_metres, TINY);
}

// The physically based BRDF for light of no size, in 1/sr.
vec3 brdf(Surface s, vec3 l, Energy energy, vec2 at_v)
{
    Fresnel f = fresnel_of(s);
    vec3 sum = light_specular(s, l, f, GEOMETRY);
    if (GEOMETRY == GEOMETRY_KARIS2013)
        sum += (1.0 - s.metallic) * diffuse_karis2013(s.base_color, f, 0.5 * length(s.v + l));
    else if (METALNESS != METALNESS_METAL || MULTI_SCATTER) {
        vec2 at_l = table_entry(brdf_table, dot(s.n, l), s.roughness);
        sum += beyond_single(energy, s.base_color, s.metallic, at_l, at_v);
    }
    return sum;
}

#endif
