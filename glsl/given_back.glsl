// How much of even light surfaces give back: all in all, and towards where.
#ifndef GIVEN_BACK_GLSL
#define GIVEN_BACK_GLSL

#include "shared.glsl"
#include "clearcoat.glsl"
#include "energy.glsl"
#include "ray_surface.glsl"
#include "sheen.glsl"

// Share that is given back; `at`: the table's entry at n.v, or its mean.
vec3 total_albedo(Energy energy, vec3 base_color, float metallic, vec2 at)
{
    Fresnel f = fresnel_from_metallic(base_color, metallic, energy.dielectric);
    vec3 specular = single_albedo(f, at) + multiple_even(energy, base_color, metallic, at);
    return min(specular + diffuse_even(energy, base_color, metallic, at), vec3(1.0));
}

// The same with the layers over the surface, sheen and a clear coat, which are seen at these cosines, or from all around if those
// are below 0.
vec3 layered_albedo(Surface s, float sheen_cosine, float cosine, vec3 albedo)
{
    if (rays_have(RAYS_SHEEN)) {
        float of_sheen = sheen_cosine < 0.0 ? sheen_mean_albedo(s.sheen_roughness) : sheen_albedo(sheen_cosine, s.sheen_roughness);
        albedo = under_sheen(s.sheen, of_sheen) * albedo + s.sheen * of_sheen;
    }
    if (!rays_have(RAYS_CLEARCOAT) || s.clearcoat <= 0.0)
        return albedo;
    Energy energy = Energy(table_mean(brdf_table, s.clearcoat_roughness), MULTI_SCATTER, CLEARCOAT_FRESNEL);
    vec2 at = cosine < 0.0 ? energy.mean : table_entry(brdf_table, cosine, s.clearcoat_roughness);
    return mix(vec3(1.0), albedo, under_clearcoat(s.clearcoat, energy, at));
}

// Share that a surface gives back as if it were matt.
vec3 matt_albedo(Surface s)
{
    Energy energy = Energy(table_mean(brdf_table, s.roughness), MULTI_SCATTER, s.dielectric);
    return layered_albedo(s, -1.0, -1.0, total_albedo(energy, s.base_color, s.metallic, energy.mean));
}

// Share that is given back over that of even light. As the BRDF is reciprocal, it holds for where light comes from, too.
vec3 over_matt(Energy energy, vec3 base_color, float metallic, vec2 at)
{
    vec3 even = total_albedo(energy, base_color, metallic, energy.mean);
    return total_albedo(energy, base_color, metallic, at) / max(even, vec3(TINY));
}

// What a hit gives back at this cosine to its triangle's normal, over what it does as if it were matt: a smooth floor mirrors more
// light towards walls than to the ceiling.
vec3 towards_over_matt(RayHit hit, float cosine)
{
    Material material = materials[bvh_material(hit.triangle)];
    vec2 uv = ray_uv(hit);
    vec3 base_color = ray_base(hit, material, uv);
    vec2 metallic_roughness = ray_metallic_roughness(hit, material, uv);
    float metallic = metallic_roughness.x, roughness = metallic_roughness.y;
    Energy energy = Energy(table_mean(brdf_table, roughness), MULTI_SCATTER, material.dielectric);
    return over_matt(energy, base_color, metallic, table_entry(brdf_table, cosine, roughness));
}

#endif
