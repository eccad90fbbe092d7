// Single scattering of a surface whose highlights may be stretched (KHR_materials_anisotropy), for lights.
#ifndef ANISOTROPY_GLSL
#define ANISOTROPY_GLSL

#include "disc.glsl"
#include "shading_point.glsl"

// With Smith's masking, whatever the terms of round highlights.
vec3 stretched_specular(Surface s, vec3 l, Fresnel f, vec2 alphas)
{
    mat3 world_from_surface = surface_basis(s);
    vec3 v = s.v * world_from_surface;
    l = l * world_from_surface;
    vec3 h = v + l;
    return reflectance(f, 0.5 * length(h)) * (d_ggx_stretched(h, alphas) * v_smith_stretched(l, v, alphas));
}

// For light of no size.
vec3 light_specular(Surface s, vec3 l, Fresnel f, int geometry)
{
    if (s.stretch == vec3(0.0))
        return specular(s.n, s.v, l, f, s.roughness, geometry);
    return stretched_specular(s, l, f, max(s.alphas, MIN_ROUGHNESS * MIN_ROUGHNESS));
}

// For a disc's light; `variance`: of the normals within the pixel. A stretched highlight is that of a point, as much wider as the
// disc's half vectors vary: their slopes vary by a quarter of the disc's sine^2 / 4, and alpha^2 stands for twice a variance.
vec3 light_disc_specular(Surface s, vec3 l, Fresnel f, float variance, float sine, int geometry)
{
    if (s.stretch == vec3(0.0))
        return disc_specular(s.n, s.v, l, f, widened_alpha(s.roughness * s.roughness, variance), sine, geometry);
    float wider = variance + 0.125 * sine * sine;
    return stretched_specular(s, l, f, max(widened_alphas(s.alphas, wider), DISC_MIN_ALPHA));
}

#endif
