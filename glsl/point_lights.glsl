// What the scene's point lights add to a surface: sums, not samples.
#ifndef POINT_LIGHTS_GLSL
#define POINT_LIGHTS_GLSL

#include "lamp.glsl"
#include "sheen.glsl"
#include "surface.glsl"
#include "shadows.glsl"

// What reaches the surface of a lamp's light, 0 to 1, on the side of this normal of its triangle.
vec3 unblocked(PointLight light, vec3 side)
{
    return LAMP_SHADOWS == LAMP_SHADOWS_NONE ? vec3(1.0) : lamp_visibility(light, position_world, side);
}

// Irradiance of all lamps on the other side of a surface, W/m^2.
vec3 point_lights_behind(Surface s, vec3 position)
{
    vec3 sum = vec3(0.0), side = -triangle_normal();
    uint count = lamp_count();
    for (uint i = 0u; i < count; ++i) {
        vec3 l;
        PointLight light = scene_light(i);
        vec3 irradiance = light_irradiance(light, position, l);
        float cosine = -dot(s.n, l);
        if (cosine > 0.0)
            sum += irradiance * cosine * unblocked(light, side);
    }
    return sum;
}

// `at_v`: the table's entry at n.v.
vec3 point_lights(Surface s, vec3 position, Energy energy, vec2 at_v)
{
    vec3 sum = vec3(0.0), side = triangle_normal();
    uint count = lamp_count();
    for (uint i = 0u; i < count; ++i) {
        vec3 l;
        PointLight light = scene_light(i);
        vec3 irradiance = light_irradiance(light, position, l);
        float nl = dot(s.n, l);
        if (nl > 0.0) {
            vec3 scattered = brdf(s, l, energy, at_v);
            sum += irradiance * (nl * unblocked(light, side)) * (SHEEN ? with_sheen(s, l, scattered) : scattered);
        }
    }
    return sum;
}

// The same by Phong, which has no table.
vec3 point_lights_phong(Surface s, vec3 position)
{
    vec3 sum = vec3(0.0), f0 = fresnel_of(s).f0, side = triangle_normal();
    uint count = lamp_count();
    for (uint i = 0u; i < count; ++i) {
        vec3 l;
        PointLight light = scene_light(i);
        vec3 irradiance = light_irradiance(light, position, l);
        vec3 lit = max(dot(s.n, l), 0.0) * unblocked(light, side);
        sum += irradiance * lit * (diffuse_lambert(s.base_color) + f0 * phong_specular(s.n, s.v, l, s.roughness));
    }
    return sum;
}

#endif
