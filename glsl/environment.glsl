// Light from the panorama, looked up in the precomputed maps.
#ifndef PBR_VR_ENVIRONMENT
#define PBR_VR_ENVIRONMENT

#include "shared.glsl"
#include "cube.glsl"
#include "levels.glsl"
#include "table.glsl"

// World direction to the frame that the panorama was stored in.
vec3 panorama_from_world(vec3 d)
{
    return rotate_y(d, vec2(frame.environment_turn.x, -frame.environment_turn.y));
}

// Irradiance of a surface facing n, over pi: what a white Lambertian surface sends out, W/(m^2 sr).
vec3 environment_diffuse(vec3 n)
{
    return texture(irradiance_over_pi, panorama_from_world(n)).rgb * frame.environment_scale;
}

// What the specular term does with light from all around.
struct SpecularLobe {
    vec3 reflectance; // its integral over the light's directions, F0 A + B: Karis (2013), eq. 8
    vec3 towards;     // where the light comes from, of any length
    float level;      // and from how far around
    vec2 entry;       // A and B
    vec2 mean_entry;  // and averaged over directions
};

// The lobe at a surface, from the table's two parts: with the Fresnel weight and without. By default each part has the
// mean vector of the BRDF's own lobe, (1 - along) r + across t, t in the plane of incidence and towards n; the table holds
// across / sin, and (n - nv r) = sin t.
SpecularLobe specular_lobe(vec3 n, vec3 v, float nv, vec3 f0, float roughness)
{
    vec2 at = table_coordinate(nv, roughness, vec2(textureSize(brdf_table, 0).xy));
    vec4 parts = textureLod(brdf_table, vec3(at, 0.0), 0.0);
    vec4 means = textureLod(brdf_table, vec3(at, 1.0), 0.0);
    vec2 across_over_sine = means.xy;
    vec2 share = vec2(dot(f0, vec3(1.0 / 3.0)), 1.0) * parts.xy;
    share /= max(share.x + share.y, TINY);
    float along = dot(share, parts.zw * parts.zw);
    float lean = dot(share, across_over_sine);
    float across2 = lean * lean * (1.0 - nv * nv);
    float mean = sqrt((1.0 - along) * (1.0 - along) + across2);
    vec3 r = reflect(-v, n);
    SpecularLobe lobe;
    lobe.reflectance = f0 * parts.x + parts.y;
    lobe.towards = (1.0 - along) * r + lean * (n - nv * r);
    lobe.level = level_from_spread((2.0 * along - along * along - across2) / (1.0 + mean)); // 1 - mean, without its loss
    lobe.entry = parts.xy;
    lobe.mean_entry = means.zw;
    return lobe;
}

// Mean radiance over a lobe.
vec3 environment_specular(SpecularLobe lobe)
{
    vec3 d = panorama_from_world(lobe.towards);
    LevelMix levels = level_mix(lobe.level);
    vec3 even = textureLod(even_levels, d, levels.even_mip).rgb, odd = textureLod(odd_levels, d, levels.odd_mip).rgb;
    return mix(even, odd, levels.odd_share) * frame.environment_scale;
}

#endif
