// What the panorama's sun adds to a surface: the BRDF over its disc, in closed form.
#ifndef SUN_LIGHT_GLSL
#define SUN_LIGHT_GLSL

#include "sun.glsl"
#include "anisotropy.glsl"
#include "energy.glsl"
#include "sheen.glsl"
#include "surface.glsl"
#include "shadows.glsl"

// What reaches the surface of the disc's light, 0 to 1, on the side of this normal of its triangle.
vec3 sun_visibility(vec3 side)
{
    return SUN_SHADOW ? sun_visibility_at(position_world, side) : vec3(1.0);
}

// Irradiance from the sun, W/m^2.
vec3 sun_irradiance(vec3 n, vec3 side)
{
    float cosine = disc_cosine(dot(n, frame.sun.towards), frame.sun.sine);
    return cosine > 0.0 ? frame.sun.irradiance * (cosine * sun_visibility(side)) : vec3(0.0);
}

// `variance`: of the normals within the pixel, both axes summed. `at_v`: the table's entry at n.v.
vec3 sun_light(Surface s, float variance, Energy energy, vec2 at_v)
{
    if (!SUN)
        return vec3(0.0);
    vec3 irradiance = sun_irradiance(s.n, triangle_normal()), l = frame.sun.towards;
    if (irradiance == vec3(0.0))
        return vec3(0.0);
    Fresnel f = fresnel_of(s);
    vec3 sum = light_disc_specular(s, l, f, variance, frame.sun.sine, GEOMETRY);
    if (GEOMETRY == GEOMETRY_KARIS2013)
        sum += (1.0 - s.metallic) * diffuse_karis2013(s.base_color, f, 0.5 * length(s.v + l));
    else if (METALNESS != METALNESS_METAL || MULTI_SCATTER) {
        vec2 at_l = table_entry(brdf_table, dot(s.n, l), s.roughness);
        sum += beyond_single(energy, s.base_color, s.metallic, at_l, at_v);
    }
    return irradiance * (SHEEN ? with_sheen(s, l, sum) : sum);
}

// The same by Phong, which has no table.
vec3 sun_light_phong(Surface s)
{
    if (!SUN)
        return vec3(0.0);
    float exponent = disc_phong_exponent(phong_exponent(s.roughness), frame.sun.sine);
    vec3 specular = fresnel_of(s).f0 * phong_lobe(s.n, s.v, frame.sun.towards, exponent);
    return sun_irradiance(s.n, triangle_normal()) * (diffuse_lambert(s.base_color) + specular);
}

#endif
