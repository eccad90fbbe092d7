// What shading needs to know of a point of a surface, however it was found.
#ifndef SHADING_POINT_GLSL
#define SHADING_POINT_GLSL

#include "brdf.glsl"
#include "sampling.glsl"

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
