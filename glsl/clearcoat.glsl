// A clear coat over a surface: a dielectric layer with a roughness and a normal of its own; twin of src/reference/clearcoat.rs; no
// bindings. It takes nothing of light on its way through: what it does not reflect towards the eye is the base's. The base so keeps
// its share whatever the light's direction, and a white one under even light stays white: "albedo scaling", Kulla and Conty (2017).
#ifndef PBR_VR_CLEARCOAT
#define PBR_VR_CLEARCOAT

#include "energy.glsl"
#include "shading_point.glsl"

// Of an index of refraction of 1.5: KHR_materials_clearcoat.
const Fresnel CLEARCOAT_FRESNEL = Fresnel(vec3(0.04), 1.0, NO_FILM);

// The coat as a surface; black, so that nothing of it is diffuse.
Surface clearcoat_layer(Surface s)
{
    s.n = s.clearcoat_n;
    s.nv = clamp(dot(s.n, s.v), MIN_COS, 1.0);
    s.base_color = vec3(0.0);
    s.metallic = 0.0;
    s.dielectric = CLEARCOAT_FRESNEL;
    s.roughness = s.clearcoat_roughness;
    s.sheen = vec3(0.0);
    s.diffuse_transmission = vec3(0.0);
    return unstretched(s);
}

// The share of its light that the base keeps below a coat of this factor; `at_v`: the table's entry at the coat's n.v.
float under_clearcoat(float factor, Energy energy, vec2 at_v)
{
    return 1.0 - factor * specular_albedo(energy, CLEARCOAT_FRESNEL, at_v).x;
}

#endif
