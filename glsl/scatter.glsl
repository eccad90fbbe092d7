// The BRDF at a surface for sampling: its value, directions drawn from it, and their density. Local space: +Z is the normal.
#ifndef SCATTER_GLSL
#define SCATTER_GLSL

#include "shared.glsl"
#include "brdf.glsl"
#include "clearcoat.glsl"
#include "energy.glsl"
#include "ray_features.glsl"
#include "sampling.glsl"
#include "sheen.glsl"
#include "shading_point.glsl"

// Below this alpha the lobe (0.006 degrees) is narrower than a texel of a 16k panorama by far, and a mirror.
const float MIRROR_ALPHA = 1e-4;

// A clear coat for light from all around; local space is the base's.
struct Coat {
    float factor;
    mat3 base_from_coat; // Z: its normal
    vec3 v; // in its own space
    float roughness;
    float alpha;
    float left;  // what it leaves of the base's light
    float share; // of the samples
    Energy energy;
    vec2 at_v;
};

// The BRDF at one point, for light from all around.
struct Scatter {
    vec3 v;
    vec3 base_color;
    Fresnel fresnel;
    float metallic;
    float roughness;
    vec2 alphas; // along x and y
    float specular_share; // of the samples: from visible normals, or to a mirror's direction
    bool mirror;
    Energy energy;
    vec2 at_v; // the table's entry
    vec3 sheen;
    float sheen_roughness;
    float left_by_sheen;
    Coat coat;
};

Coat make_coat(Surface s, vec3 v, mat3 world_from_surface)
{
    Coat c;
    c.factor = s.clearcoat;
    c.base_from_coat = basis(s.clearcoat_n * world_from_surface);
    v = v * c.base_from_coat;
    c.v = normalize(vec3(v.xy, max(v.z, MIN_COS)));
    c.roughness = s.clearcoat_roughness;
    c.alpha = c.roughness * c.roughness;
    c.energy = Energy(table_mean(brdf_table, c.roughness), MULTI_SCATTER, CLEARCOAT_FRESNEL);
    c.at_v = table_entry(brdf_table, c.v.z, c.roughness);
    c.left = under_clearcoat(c.factor, c.energy, c.at_v);
    // As of the base's specular part; none where there is no coat.
    c.share = c.factor > 0.0 ? max(1.0 - c.left, 0.1) : 0.0;
    return c;
}

// The coat's part of the BRDF times its own n.l, for unit l of the base's space.
float coat_scattered(Coat c, vec3 l)
{
    l = l * c.base_from_coat;
    if (l.z <= 0.0)
        return 0.0;
    vec3 h = c.v + l;
    float single = f_schlick(CLEARCOAT_FRESNEL, 0.5 * length(h)).x * d_ggx(vec3(0.0, 0.0, 1.0), h, c.alpha)
        * v_environment(l.z, c.v.z, c.roughness, GEOMETRY);
    vec2 at_l = table_entry(brdf_table, l.z, c.roughness);
    return c.factor * l.z * (single + multiple(c.energy, multiple_share(c.energy, CLEARCOAT_FRESNEL), at_l, c.at_v).x);
}

// `world_from_surface`: of surface_basis.
Scatter make_scatter(Surface s, mat3 world_from_surface)
{
    Scatter m;
    vec3 v = s.v * world_from_surface;
    m.v = normalize(vec3(v.xy, max(v.z, MIN_COS)));
    m.base_color = s.base_color;
    m.fresnel = fresnel_of(s);
    m.metallic = s.metallic;
    m.roughness = s.roughness;
    m.mirror = max(s.alphas.x, s.alphas.y) < MIRROR_ALPHA;
    m.alphas = m.mirror ? s.alphas : max(s.alphas, MIRROR_ALPHA);
    // A mirror has no microfacets that light could bounce between.
    m.energy = Energy(table_mean(brdf_table, s.roughness), MULTI_SCATTER && !m.mirror, s.dielectric);
    m.at_v = table_entry(brdf_table, m.v.z, s.roughness);
    vec3 f = reflectance(m.fresnel, m.v.z);
    vec3 diffuse = (1.0 - s.metallic) * s.base_color + multiple_even(m.energy, s.base_color, s.metallic, m.at_v);
    if (rays_have(RAYS_SHEEN)) {
        float albedo = sheen_albedo(m.v.z, s.sheen_roughness);
        m.sheen = s.sheen;
        m.sheen_roughness = s.sheen_roughness;
        m.left_by_sheen = under_sheen(s.sheen, albedo);
        diffuse += s.sheen * albedo;
    }
    float specular = max(f.r, max(f.g, f.b)), matte = max(diffuse.r, max(diffuse.g, diffuse.b));
    // Never below a tenth: the specular part has peaks that cosine samples do not find.
    m.specular_share = matte > 0.0 ? max(specular / (specular + matte), 0.1) : 1.0;
    if (rays_have(RAYS_CLEARCOAT))
        m.coat = make_coat(s, m.v, world_from_surface);
    return m;
}

float scatter_visibility(Scatter m, vec3 l)
{
    return GEOMETRY == GEOMETRY_KARIS2013 ? v_karis2013_ibl(l.z, m.v.z, m.roughness) : v_smith_stretched(l, m.v, m.alphas);
}

// BRDF times n.l for unit l above the surface; of a mirror without single scattering.
vec3 scattered(Scatter m, vec3 l)
{
    vec3 h = m.v + l;
    float vh = 0.5 * length(h);
    vec3 sum;
    if (GEOMETRY == GEOMETRY_KARIS2013)
        sum = (1.0 - m.metallic) * diffuse_karis2013(m.base_color, m.fresnel, vh);
    else
        sum = beyond_single(m.energy, m.base_color, m.metallic, table_entry(brdf_table, l.z, m.roughness), m.at_v);
    if (!m.mirror)
        sum += reflectance(m.fresnel, vh) * (d_ggx_stretched(h, m.alphas) * scatter_visibility(m, l));
    if (rays_have(RAYS_SHEEN))
        sum = m.left_by_sheen * sum + m.sheen * sheen_brdf(vec3(0.0, 0.0, 1.0), m.v, l, m.sheen_roughness);
    return rays_have(RAYS_CLEARCOAT) ? sum * (m.coat.left * l.z) + coat_scattered(m.coat, l) : sum * l.z;
}

// The diffuse part of it; with GEOMETRY_SMITH alone.
vec3 scattered_diffuse(Scatter m, vec3 l)
{
    vec2 at_l = table_entry(brdf_table, l.z, m.roughness);
    float left = (rays_have(RAYS_CLEARCOAT) ? m.coat.left : 1.0) * (rays_have(RAYS_SHEEN) ? m.left_by_sheen : 1.0);
    return (left * (1.0 - m.metallic) * l.z) * diffuse_kelemen2001(m.energy, m.base_color, at_l, m.at_v);
}

// Density of `sample_scatter`, 1/sr; of a mirror that of its other directions.
float scatter_density(Scatter m, vec3 l)
{
    float density = (1.0 - m.specular_share) * l.z * INV_PI;
    if (!m.mirror)
        density += m.specular_share * pdf_vndf(m.v, m.v + l, m.alphas);
    if (rays_have(RAYS_CLEARCOAT) && m.coat.share > 0.0)
        density = mix(density, pdf_vndf(m.coat.v, m.coat.v + l * m.coat.base_from_coat, vec2(m.coat.alpha)), m.coat.share);
    return density;
}

// By which a mirror's own light is multiplied where `sample_scatter` has drawn it.
vec3 mirrored_weight(Scatter m)
{
    vec3 weight = reflectance(m.fresnel, m.v.z) / m.specular_share;
    if (rays_have(RAYS_SHEEN))
        weight *= m.left_by_sheen;
    return rays_have(RAYS_CLEARCOAT) ? weight * (m.coat.left / (1.0 - m.coat.share)) : weight;
}

// A direction, and whether it is a mirror's own, which has no density: then light is weighted by Fresnel over the share.
vec3 sample_scatter(Scatter m, uvec4 bits, out bool mirrored)
{
    vec2 u = units_from_bits(bits.xy);
    float which = unit_from_bits(bits.z);
    mirrored = false;
    if (rays_have(RAYS_CLEARCOAT)) {
        if (which < m.coat.share)
            return m.coat.base_from_coat * reflect(-m.coat.v, sample_vndf(m.coat.v, u, vec2(m.coat.alpha)));
        which = (which - m.coat.share) / (1.0 - m.coat.share);
    }
    bool specular = which < m.specular_share;
    mirrored = specular && m.mirror;
    if (mirrored)
        return vec3(-m.v.xy, m.v.z);
    return specular ? reflect(-m.v, sample_vndf(m.v, u, m.alphas)) : cosine_direction(u);
}

#endif
