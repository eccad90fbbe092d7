// What shading needs to know of a point of a surface, however it was found.
#ifndef SHADING_POINT_GLSL
#define SHADING_POINT_GLSL

#include "brdf.glsl"

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
};

Fresnel fresnel_of(Surface s)
{
    return fresnel_from_metallic(s.base_color, s.metallic, s.dielectric);
}

#endif
