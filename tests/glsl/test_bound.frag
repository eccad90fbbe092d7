// An upper bound of what the sun and the point lights add to a surface, from the irradiance of each:
// src/render/random_gpu_tests.rs compares their light with it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "brdf.glsl"
#include "point_lights.glsl"
#include "surface.glsl"
#include "sun_light.glsl"

layout(location = 0) out vec4 colour;

void cut_out(float above) {}

// D is at most 1 / pi alpha^2, at its lobe's centre, and V nl at most 0.5 / sqrt(alpha^2 + (1 - alpha^2) nv^2), the first
// of its two terms alone. Karis's V nl, 0.25 / (nv (1 - k) + k) at most, and Phong's peak, 0.08 / alpha^2 + 0.24, are less.
// All that is not single scattering is less than 1 / sr.
float peak(float alpha, float nv)
{
    float a2 = alpha * alpha;
    return 0.5 * INV_PI / (a2 * sqrt(a2 + (1.0 - a2) * nv * nv)) + 1.0;
}

void main()
{
    Surface s = read_surface();
    vec3 sum = frame.sun.irradiance * peak(max(s.roughness * s.roughness, DISC_MIN_ALPHA), s.nv), l;
    for (uint i = 0u; i < (LIGHTS < 0 ? frame.light_count : 0u); ++i)
        sum += light_irradiance(lights[i], position_world, l) * peak(alpha_from_roughness(s.roughness), s.nv);
    colour = vec4(sum, 1.0);
}
