// What microfacets give back by second and later bounces, and a diffuse part of what the specular part leaves; twins of
// src/reference/energy.rs; no bindings. Entries are A and B of the split sum's table (F0 A + B) at n.l or n.v.
#ifndef PBR_VR_ENERGY
#define PBR_VR_ENERGY

#include "brdf.glsl"
#include "table.glsl"

// The terms at one roughness.
struct Energy {
    vec2 mean;     // the entry averaged over directions
    bool multiple; // else single scattering alone, and nothing is given back
    Fresnel dielectric; // of the part that is no metal
};

// Least share that is divided by: below, a lobe is 0 over 0.
const float LEAST_LOST = 1e-6;

// What single scattering loses where all is reflected, 1 - (A + B).
float lost(vec2 entry)
{
    return max(1.0 - entry.x - entry.y, 0.0);
}

// What the lost light is multiplied by before it comes back. Kulla and Conty, "Revisiting Physically Based Shading at
// Imageworks" (2017), section on Fresnel, with Schlick's mean F0 + (F90 - F0) / 21.
vec3 multiple_share(Energy energy, Fresnel fresnel)
{
    if (!energy.multiple)
        return vec3(0.0);
    float mean = energy.mean.x + energy.mean.y;
    vec3 f = fresnel.f0 + (fresnel.f90 - fresnel.f0) / 21.0;
    return f * f * mean / (1.0 - f * (1.0 - mean));
}

// The same for a surface that is in part metal.
vec3 mixed_share(Energy energy, vec3 base_color, float metallic)
{
    return mix(multiple_share(energy, energy.dielectric), multiple_share(energy, bare_fresnel(base_color, 1.0)), metallic);
}

// Multiple scattering in 1/sr for a share: Kulla and Conty (2017).
vec3 multiple(Energy energy, vec3 share, vec2 at_l, vec2 at_v)
{
    return share * (lost(at_l) * lost(at_v) * INV_PI / max(lost(energy.mean), LEAST_LOST));
}

// Share of light from all sides that single and multiple scattering send towards v.
vec3 specular_albedo(Energy energy, Fresnel f, vec2 at_v)
{
    return single_albedo(f, at_v) + lost(at_v) * multiple_share(energy, f);
}

// What a dielectric's specular part leaves, the same of all colours: of the one that it reflects most (KHR_materials_specular).
float left_by_dielectric(Energy energy, vec2 entry)
{
    vec3 specular = specular_albedo(energy, energy.dielectric, entry);
    return 1.0 - max(specular.r, max(specular.g, specular.b));
}

// The diffuse part in 1/sr: of what the dielectric's specular part leaves at both ends. Kelemen and Szirmay-Kalos, "A
// Microfacet Based Coupled Specular-Matte BRDF Model with Importance Sampling" (2001), eq. 6.
vec3 diffuse_kelemen2001(Energy energy, vec3 albedo, vec2 at_l, vec2 at_v)
{
    float ends = left_by_dielectric(energy, at_l) * left_by_dielectric(energy, at_v);
    return albedo * (ends * INV_PI / max(left_by_dielectric(energy, energy.mean), LEAST_LOST));
}

// All that is not single scattering, in 1/sr.
vec3 beyond_single(Energy energy, vec3 base_color, float metallic, vec2 at_l, vec2 at_v)
{
    vec3 sum = (1.0 - metallic) * diffuse_kelemen2001(energy, base_color, at_l, at_v);
    return energy.multiple ? sum + multiple(energy, mixed_share(energy, base_color, metallic), at_l, at_v) : sum;
}

// Of light that comes evenly from all sides, the share that comes back diffuse. As each of these terms is one function of l
// times one of v, and is divided by the first one's integral, n.l included, these are the integrals over l.
vec3 diffuse_even(Energy energy, vec3 base_color, float metallic, vec2 at_v)
{
    return (1.0 - metallic) * left_by_dielectric(energy, at_v) * base_color;
}

// And scattered more than once.
vec3 multiple_even(Energy energy, vec3 base_color, float metallic, vec2 at_v)
{
    return lost(at_v) * mixed_share(energy, base_color, metallic);
}

// What the diffuse part takes of light from all around, over what it takes of the same irradiance of even light, by how much of it
// is grazing: its mean of 21 (1 - n.l)^5 under the cosine, which is 1 for even light. Smooth dielectrics leave
// 0.96 (1 - (1 - n.l)^5), for which this is exact; for rough ones the factor is fitted (src/precompute/README.md).
float diffuse_taken(float roughness, float grazing)
{
    return max(1.0 - (grazing - 1.0) / (20.0 + 460.0 * roughness * roughness * roughness), 0.0);
}

// The same for multiple scattering.
float multiple_taken(float roughness, float grazing)
{
    return max(1.0 + (grazing - 1.0) * clamp(0.047 / (roughness * roughness) - 0.157, -0.065, 1.0), 0.0);
}

// The table's entry at n.l or n.v.
vec2 table_entry(sampler2DArray table, float cosine, float roughness)
{
    vec2 at = table_coordinate(cosine, roughness, vec2(textureSize(table, 0).xy));
    return textureLod(table, vec3(at, 0.0), 0.0).xy;
}

// And averaged over directions: any place along the row holds it.
vec2 table_mean(sampler2DArray table, float roughness)
{
    vec2 at = table_coordinate(1.0, roughness, vec2(textureSize(table, 0).xy));
    return textureLod(table, vec3(at, 1.0), 0.0).zw;
}

#endif
