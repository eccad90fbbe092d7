// What shading needs to know of a point of a surface, however it was found.
#ifndef SHADING_POINT_GLSL
#define SHADING_POINT_GLSL

#include "brdf.glsl"
#include "sampling.glsl"

// Least roughness of sheen: below it, more would come back at grazing angles than arrives.
const float MIN_SHEEN_ROUGHNESS = 0.2;

struct Surface {
    vec3 n; // shading normal, towards the eye's side
    vec3 v; // to the eye
    float nv;
    vec3 base_color;
    float metallic;
    Fresnel dielectric; // of the part that is no metal
    float roughness;
    float occlusion;
    vec3 emission; // radiance, W/(m^2 sr)
    float alpha;   // coverage
    vec3 transmission; // by which what is not covered is multiplied
    float clearcoat; // share that has a clear coat
    float clearcoat_roughness;
    vec3 clearcoat_n; // its normal, as n
    vec3 sheen; // color of the layer of fibres over it; black where there is none
    float sheen_roughness;
    vec3 diffuse_transmission; // albedo of what light from the other side diffuses through
    vec3 stretch; // unit direction on the surface in which highlights are stretched; 0 where they are not
    vec2 alphas;  // along it and across it
};

Surface unstretched(Surface s)
{
    s.stretch = vec3(0.0);
    s.alphas = vec2(s.roughness * s.roughness);
    return s;
}

// The surface with its highlights stretched along `along`. Its roughness becomes that of a round lobe with the root mean square of
// both alphas, which on average over all views is what masking sees: its albedo is that of the stretched one to 5 %.
Surface stretched(Surface s, vec3 along, float strength)
{
    s = unstretched(s);
    s.stretch = normalize_or(along - dot(along, s.n) * s.n, vec3(0.0));
    if (s.stretch == vec3(0.0))
        return s;
    s.alphas = stretched_alphas(s.alphas.y, strength);
    s.roughness = sqrt(sqrt(0.5 * dot(s.alphas, s.alphas)));
    return s;
}

// The surface with a share of the light that is no metal's mirror image going through to the other side instead: its dielectric
// part is white light's mixture of a Lambertian reflection and a Lambertian transmission (KHR_materials_diffuse_transmission).
Surface diffusing_through(Surface s, float share, vec3 color)
{
    share *= 1.0 - s.metallic;
    s.base_color *= 1.0 - share;
    s.diffuse_transmission = share * color;
    return s;
}

// What such a surface is for light that comes from its other side: Lambertian and seen as from there. `left`: what the surface's
// specular part and its layers leave of diffuse light towards the eye.
Surface other_side(Surface s, float left)
{
    s.n = -s.n;
    s.v = reflect(s.v, s.n);
    s.base_color = s.diffuse_transmission * left;
    s.diffuse_transmission = vec3(0.0);
    s.metallic = 0.0;
    s.dielectric = bare_fresnel(vec3(0.0), 0.0);
    s.roughness = 1.0;
    s.clearcoat = 0.0;
    s.clearcoat_n = s.n;
    s.sheen = vec3(0.0);
    return unstretched(s);
}

// Columns: along the stretch or any direction, across it, and the normal.
mat3 surface_basis(Surface s)
{
    if (s.stretch == vec3(0.0))
        return basis(s.n);
    return mat3(s.stretch, cross(s.n, s.stretch), s.n);
}

Fresnel fresnel_of(Surface s)
{
    return fresnel_from_metallic(s.base_color, s.metallic, s.dielectric);
}

#endif
