// Light from the panorama, looked up in the precomputed maps.
#ifndef PBR_VR_ENVIRONMENT
#define PBR_VR_ENVIRONMENT

#include "levels.glsl"
#include "panorama.glsl"
#include "table.glsl"

// Irradiance of a surface facing n, over pi: what a white Lambertian surface sends out, W/(m^2 sr).
vec3 environment_diffuse(vec3 n)
{
    return texture(irradiance_over_pi, panorama_from_world(n)).rgb * frame.environment_scale;
}

// One round lobe for the BRDF's own, or for half of it.
struct LobePart {
    vec3 reflectance; // its integral over the light's directions, F0 A + B: Karis (2013), eq. 8
    vec3 towards;     // where the light comes from, of any length
    float level;      // and from how far around
};

// What the specular term does with light from all around.
struct SpecularLobe {
    LobePart first; // all of it, or with SLICES what leans towards the eye
    LobePart second;
    vec3 reflectance;
    vec2 entry;      // A and B
    vec2 mean_entry; // and averaged over directions
};

// A lobe from its two parts in the table, with the Fresnel weight and without. By default each has the mean vector of the
// BRDF's own lobe, (1 - along) r + across t, t in the plane of incidence and towards n, of any length that suits `across`.
LobePart lobe_part(vec2 weights, vec2 root_along, vec2 across, vec3 r, vec3 t, vec3 f0)
{
    vec2 share = vec2(dot(f0, vec3(1.0 / 3.0)), 1.0) * weights;
    share /= max(share.x + share.y, TINY);
    float along = dot(share, root_along * root_along);
    float lean = dot(share, across);
    float across2 = lean * lean * dot(t, t);
    float mean = sqrt((1.0 - along) * (1.0 - along) + across2);
    LobePart part;
    part.reflectance = f0 * weights.x + weights.y;
    part.towards = (1.0 - along) * r + lean * t;
    part.level = level_from_spread((2.0 * along - along * along - across2) / (1.0 + mean)); // 1 - mean, without its loss
    return part;
}

// Of length 1 and perpendicular to r, in the plane of incidence where there is one.
vec3 unit_across(vec3 r, vec3 t)
{
    vec3 aside = cross(r, abs(r.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0));
    return normalize(dot(t, t) > 1e-6 ? t : aside);
}

// The table holds the whole lobe's across / sin, which has a limit where n = v, and the halves' as it is, which has none.
SpecularLobe specular_lobe(vec3 n, vec3 v, float nv, vec3 f0, float roughness)
{
    vec2 at = table_coordinate(nv, roughness, vec2(textureSize(brdf_table, 0).xy));
    vec4 parts = textureLod(brdf_table, vec3(at, 0.0), 0.0);
    vec4 means = textureLod(brdf_table, vec3(at, 1.0), 0.0);
    vec3 r = reflect(-v, n), t = n - nv * r;
    SpecularLobe lobe;
    if (SLICES) {
        vec4 first = textureLod(brdf_table, vec3(at, 2.0), 0.0), across = textureLod(brdf_table, vec3(at, 3.0), 0.0);
        vec2 second_root_along = textureLod(brdf_table, vec3(at, 4.0), 0.0).xy;
        t = unit_across(r, t);
        lobe.first = lobe_part(first.xy, first.zw, across.xy, r, t, f0);
        lobe.second = lobe_part(max(parts.xy - first.xy, 0.0), second_root_along, across.zw, r, t, f0);
    } else {
        lobe.first = lobe_part(parts.xy, parts.zw, means.xy, r, t, f0);
    }
    lobe.reflectance = f0 * parts.x + parts.y;
    lobe.entry = parts.xy;
    lobe.mean_entry = means.zw;
    return lobe;
}

// What part of a lobe reflects of the light around it.
vec3 reflected_light(LobePart part)
{
    vec3 d = panorama_from_world(part.towards);
    LevelMix levels = level_mix(part.level);
    vec3 even = textureLod(specular_even, d, levels.even_mip).rgb, odd = textureLod(specular_odd, d, levels.odd_mip).rgb;
    return part.reflectance * mix(even, odd, levels.odd_share) * frame.environment_scale;
}

// What a lobe reflects of the panorama.
vec3 environment_specular(SpecularLobe lobe)
{
    vec3 light = reflected_light(lobe.first);
    return SLICES ? light + reflected_light(lobe.second) : light;
}

#endif
