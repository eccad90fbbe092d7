// Light from the panorama, looked up in the precomputed maps.
#ifndef PBR_VR_ENVIRONMENT
#define PBR_VR_ENVIRONMENT

#include "levels.glsl"
#include "panorama.glsl"
#include "split_sum.glsl"
#include "table.glsl"

// Light of all directions that a surface facing n has.
struct EvenLight {
    vec3 over_pi;  // irradiance over pi: what a white Lambertian surface sends out, W/(m^2 sr)
    float grazing; // how much of it is grazing: see diffuse_taken
};

EvenLight environment_even(vec3 n)
{
    vec4 texel = texture(irradiance_over_pi, panorama_from_world(n));
    return EvenLight(texel.rgb * frame.environment_scale, texel.a);
}

// What the specular term does with light from all around.
struct SpecularLobe {
    vec3 reflectance; // its integral over the light's directions, F0 A + B: Karis (2013), eq. 8
    float even;       // the share of the irradiance in it; the rest comes
    vec3 towards;     // from this direction, of any length,
    float spread;     // 1 - length of the mean of all directions that it comes from
    float level;      // of the maps for that
    vec2 entry;       // A and B
    vec2 mean_entry;  // and averaged over directions
};

// By default irradiance and round lobe have both moments of the BRDF's own lobe (src/precompute/README.md).
SpecularLobe specular_lobe(vec3 n, vec3 v, float nv, vec3 f0, float roughness)
{
    vec2 at = table_coordinate(nv, roughness, vec2(textureSize(brdf_table, 0).xy));
    vec4 parts = textureLod(brdf_table, vec3(at, 0.0), 0.0);
    vec4 means = textureLod(brdf_table, vec3(at, 1.0), 0.0);
    vec2 share = vec2(dot(f0, vec3(1.0 / 3.0)), 1.0) * parts.xy, along = parts.zw * parts.zw;
    share /= max(share.x + share.y, TINY);
    float even = TWO_MOMENTS ? share.x * along.x * textureLod(brdf_table, vec3(at, 2.0), 0.0).x : 0.0;
    vec3 r = reflect(-v, n), t = n - nv * r;
    Match found = match_lobe(even, dot(share, along), dot(share, means.xy), nv, dot(t, t));
    SpecularLobe lobe;
    lobe.reflectance = f0 * parts.x + parts.y;
    lobe.even = even;
    lobe.towards = found.towards.x * r + found.towards.y * t;
    lobe.spread = found.spread;
    lobe.level = level_from_spread(found.spread);
    lobe.entry = parts.xy;
    lobe.mean_entry = means.zw;
    return lobe;
}

// The share of even light that the round lobe reflects.
vec3 round_reflectance(SpecularLobe lobe)
{
    return lobe.reflectance * (1.0 - lobe.even);
}

// Radiance of the panorama from around a direction of any length.
vec3 environment_image(vec3 towards, float level)
{
    vec3 d = panorama_from_world(towards);
    LevelMix levels = level_mix(level);
    vec3 even = textureLod(specular_even, d, levels.even_mip).rgb, odd = textureLod(specular_odd, d, levels.odd_mip).rgb;
    return mix(even, odd, levels.odd_share) * frame.environment_scale;
}

#endif
