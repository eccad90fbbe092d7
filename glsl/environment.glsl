// Light from the panorama, looked up in the precomputed maps.
#ifndef PBR_VR_ENVIRONMENT
#define PBR_VR_ENVIRONMENT

#include "shared.glsl"
#include "cube.glsl"
#include "levels.glsl"

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

// Radiance from around r, averaged by the lobe of this roughness for n = v = r.
vec3 environment_specular(vec3 r, float roughness)
{
    float level = level_from_roughness(roughness, frame.last_level);
    return textureLod(specular_levels, panorama_from_world(r), level).rgb * frame.environment_scale;
}

// Directional albedo of the specular term, F0 A + B: Karis (2013), eq. 8.
vec3 environment_reflectance(vec3 f0, float nv, float roughness)
{
    vec2 ab = textureLod(brdf_table, vec2(nv, roughness), 0.0).rg;
    return f0 * ab.x + ab.y;
}

#endif
