// Light from the panorama, looked up in the precomputed maps.
#ifndef PBR_VR_ENVIRONMENT
#define PBR_VR_ENVIRONMENT

#include "brdf.glsl"
#include "levels.glsl"
#include "panorama.glsl"
#include "split_sum.glsl"
#include "table.glsl"

const uint ONE_LOBE = 2, TWO_LOBES = 3; // of SPLIT_SUM

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
    vec3 reflectance; // its integral over the light's directions, F0 A + F90 B: Karis (2013), eq. 8
    float even;       // the share of the irradiance in it; the rest comes
    vec3 towards;     // from around this direction, of any length:
    vec3 apart;       // from two round lobes, along towards + apart and towards - apart; of one where this is 0
    float spread;     // of both: 1 - length of the mean of all directions that it comes from
    float level;      // of the maps for each
    vec2 entry;       // A and B
    vec2 mean_entry;  // and averaged over directions
};

// Irradiance and round lobes together have the mean vector of the BRDF's own lobe (src/precompute/README.md), but for what normals
// of this variance within the pixel take of it.
SpecularLobe specular_lobe(vec3 n, vec3 v, float nv, Fresnel f, float roughness, float variance)
{
    vec2 at = table_coordinate(nv, roughness, vec2(textureSize(brdf_table, 0).xy));
    vec4 parts = textureLod(brdf_table, vec3(at, 0.0), 0.0);
    vec4 means = textureLod(brdf_table, vec3(at, 1.0), 0.0);
    vec2 share = vec2(dot(f.f0, vec3(1.0 / 3.0)), f.f90) * parts.xy, along = parts.zw * parts.zw;
    share /= max(share.x + share.y, TINY);
    float even = SPLIT_SUM >= ONE_LOBE ? share.x * along.x * even_over_along(nv, roughness) : 0.0;
    vec3 r = reflect(-v, n), t = n - nv * r;
    float sin2 = dot(t, t);
    Match found = match_lobe(even, dot(share, along), dot(share, means.xy), nv, sin2);
    found.spread = turned_spread(found.spread, nv, variance);
    float share_apart = SPLIT_SUM == TWO_LOBES ? apart_over_sin2(roughness) : 0.0;
    Pair pair = split_lobe(found, share_apart, sin2);
    SpecularLobe lobe;
    lobe.reflectance = single_albedo(f, parts.xy);
    lobe.even = even;
    lobe.towards = found.towards.x * r + found.towards.y * t;
    lobe.apart = pair.apart.x * r + pair.apart.y * t;
    lobe.spread = found.spread;
    lobe.level = level_from_spread(pair.spread);
    lobe.entry = parts.xy;
    lobe.mean_entry = means.zw;
    return lobe;
}

// The share of even light that the round lobes reflect.
vec3 round_reflectance(SpecularLobe lobe)
{
    return lobe.reflectance * (1.0 - lobe.even);
}

// Radiance of the panorama from around a direction of any length.
vec3 environment_around(vec3 towards, LevelMix levels)
{
    vec3 d = panorama_from_world(towards);
    vec3 even = textureLod(specular_even, d, levels.even_mip).rgb, odd = textureLod(specular_odd, d, levels.odd_mip).rgb;
    return mix(even, odd, levels.odd_share);
}

// The mean of the round lobes' radiance, of the panorama alone. The loop is not unrolled, which saves a software renderer a tenth of
// the frame. Its sum changes within a condition because Mesa 22.3's otherwise goes on adding for fragments that have left the loop.
vec3 environment_image(SpecularLobe lobe)
{
    LevelMix levels = level_mix(lobe.level);
    vec3 sum = vec3(0.0);
    bool two = lobe.apart != vec3(0.0);
    float side = 1.0, last = two ? -1.0 : 1.0;
    do {
        if (side >= last)
            sum += environment_around(lobe.towards + side * lobe.apart, levels);
        side -= 2.0;
    } while (side >= last);
    return sum * (two ? 0.5 * frame.environment_scale : frame.environment_scale);
}

#endif
