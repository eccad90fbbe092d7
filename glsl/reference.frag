// Shades one fragment without split sum: the BRDF integrated over the panorama's texels, a few samples a
// frame. A table gives only what of the BRDF is itself an integral, the shares that microfacets lose.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "brdf.glsl"
#include "energy.glsl"
#include "sampling.glsl"
#include "surface.glsl"
#include "point_lights.glsl"
#include "importance.glsl"

layout(location = 0) out vec4 radiance;

// Pairs of samples per fragment and frame: bounded work, far below what any watchdog allows.
const uint PAIRS = 4;

// Below this alpha the lobe (0.006 degrees) is narrower than a texel of a 16k panorama by far, and a mirror.
const float MIRROR_ALPHA = 1e-4;

// The BRDF at a surface whose normal is +Z, for light from all around.
struct Scatter {
    vec3 v;
    vec3 base_color;
    vec3 f0;
    float metallic;
    float roughness;
    float alpha;
    float specular_share; // of the BRDF's own samples
    bool mirror;
    Energy energy;
    vec2 at_v; // the table's entry
};

Scatter make_scatter(Surface s, mat3 world_from_surface)
{
    Scatter m;
    vec3 v = s.v * world_from_surface;
    m.v = normalize(vec3(v.xy, max(v.z, MIN_COS)));
    m.base_color = s.base_color;
    m.f0 = f0_from_metallic(s.base_color, s.metallic);
    m.metallic = s.metallic;
    m.roughness = s.roughness;
    m.alpha = s.roughness * s.roughness;
    m.mirror = m.alpha < MIRROR_ALPHA;
    m.energy = Energy(table_mean(brdf_table, s.roughness), MULTI_SCATTER);
    m.at_v = table_entry(brdf_table, m.v.z, s.roughness);
    vec3 f = f_schlick(m.f0, m.v.z);
    vec3 diffuse = (1.0 - s.metallic) * s.base_color + multiple_even(m.energy, s.base_color, s.metallic, m.at_v);
    float specular = max(f.r, max(f.g, f.b)), matte = max(diffuse.r, max(diffuse.g, diffuse.b));
    // Never below a tenth: the specular part has peaks that cosine samples do not find.
    m.specular_share = m.mirror ? 0.0 : matte > 0.0 ? clamp(specular / (specular + matte), 0.1, 0.9) : 1.0;
    return m;
}

// BRDF times n.l for unit l above the surface; of a mirror without single scattering.
vec3 scattered(Scatter m, vec3 l)
{
    vec3 h = m.v + l;
    float vh = 0.5 * length(h);
    vec3 sum;
    if (GEOMETRY == GEOMETRY_KARIS2013)
        sum = (1.0 - m.metallic) * diffuse_karis2013(m.base_color, m.f0, vh);
    else
        sum = beyond_single(m.energy, m.base_color, m.metallic, table_entry(brdf_table, l.z, m.roughness), m.at_v);
    if (!m.mirror)
        sum += f_schlick(m.f0, vh) * (d_ggx(vec3(0.0, 0.0, 1.0), h, m.alpha) * v_environment(l.z, m.v.z, m.roughness, GEOMETRY));
    return sum * l.z;
}

// Density of `sample_scatter`, 1/sr.
float scatter_density(Scatter m, vec3 l)
{
    float specular = m.mirror ? 0.0 : pdf_vndf(m.v, m.v + l, m.alpha);
    return mix(l.z * INV_PI, specular, m.specular_share);
}

vec3 sample_scatter(Scatter m, uvec4 bits)
{
    vec2 u = vec2(unit_from_bits(bits.x), unit_from_bits(bits.y));
    if (unit_from_bits(bits.z) < m.specular_share)
        return reflect(-m.v, sample_vndf(m.v, u, m.alpha));
    // Cosine: Malley's method, a disc projected up.
    float radius = sqrt(u.x), phi = 2.0 * PI * u.y;
    return vec3(radius * cos(phi), radius * sin(phi), sqrt(1.0 - u.x));
}

// One sample's share: with two samples of different densities and the balance heuristic (Veach, "Robust Monte Carlo Methods
// for Light Transport Simulation" (1997), eq. 9.8) each counts f / (p1 + p2), whichever it came from.
vec3 one_sample(Scatter m, vec3 l, mat3 world_from_surface)
{
    if (l.z <= 0.0)
        return vec3(0.0);
    vec3 l_panorama = panorama_from_world(world_from_surface * l);
    float density = scatter_density(m, l) + panorama_density(l_panorama);
    return density > 0.0 ? scattered(m, l) * panorama_radiance(l_panorama) / density : vec3(0.0);
}

vec3 environment_light(Surface s)
{
    mat3 world_from_surface = basis(s.n);
    Scatter m = make_scatter(s, world_from_surface);
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < PAIRS; ++i) {
        uvec4 seed = uvec4(gl_FragCoord.xy, frame.sample_index, 2u * (PAIRS * eye + i));
        vec3 l_world = world_from_panorama(sample_panorama(pcg4d(seed)));
        sum += one_sample(m, l_world * world_from_surface, world_from_surface);
        seed.w += 1u;
        sum += one_sample(m, sample_scatter(m, pcg4d(seed)), world_from_surface);
    }
    sum /= float(PAIRS);
    if (m.mirror) {
        vec3 l = vec3(-m.v.xy, m.v.z);
        sum += f_schlick(m.f0, m.v.z) * panorama_radiance(panorama_from_world(world_from_surface * l));
    }
    return sum * s.occlusion;
}

void cut_out(float above)
{
    if (above < 0.0)
        discard;
}

void main()
{
    Surface s = read_surface();
    Energy energy = Energy(table_mean(brdf_table, s.roughness), MULTI_SCATTER);
    vec3 points = point_lights(s, energy, table_entry(brdf_table, s.nv, s.roughness));
    radiance = vec4(environment_light(s) + points, 1.0);
}
