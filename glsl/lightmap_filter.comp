// Takes noise out of a lightmap: each texel gets a mean of those around it on the same surface that differ from it by no more
// than their noise does. A joint bilateral filter whose range follows the samples' own variance: Rousselle, Knaus and Zwicker,
// "Adaptive Rendering with Non-Local Means Filtering" (2012), sections 4 and 5.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap_beside.glsl"

const int REACH = 3; // texels
// Of the variance of both texels' noise: by how much the squares of what the filter goes by may differ.
const float RANGE = 1.5;
// How likely it is noise alone that two texels differ by in the parts of their rays that met nothing, whose number has a binomial
// distribution.
float alike_open(LightmapSurface a, LightmapSurface b)
{
    vec2 rays = max(vec2(a.rays, b.rays), 1.0), open = vec2(a.unblocked.w, b.unblocked.w) / rays;
    // As if one more ray had met something, and one nothing: few rays do not show that none does.
    vec2 likely = (open * rays + 1.0) / (rays + 2.0);
    float apart = open.x - open.y;
    return exp(-apart * apart / dot(likely * (1.0 - likely), 1.0 / rays));
}

// What another texel has met nothing in, around the normal of this one: across a curved surface it would be shorter else, as if
// something blocked. The least rotation from normal a to b.
vec3 turned(vec3 v, vec3 a, vec3 b)
{
    vec3 between = a + b;
    return v - dot(between, v) / (1.0 + dot(a, b)) * between + 2.0 * dot(a, v) * b;
}

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    ivec3 at = texel_address(lightmap_texels[index]);
    LightmapSurface s = lightmap_surfaces[index];
    if (lightmap_sums[index].all.a == 0.0)
        return;
    mat3 models = mat3(frame.world_from_models);
    vec4 guide = lightmap_sums[index].kept, light = vec4(0.0), unblocked = vec4(0.0);
    vec3 surfaces = vec3(0.0), given = vec3(0.0);
    float rays = 0.0, variance = 0.0;
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            uint beside = texel_at(at + ivec3(x, y, 0));
            if (beside == NO_TEXEL)
                continue;
            vec2 off = vec2(x, y);
            LightmapSurface other = lightmap_surfaces[beside];
            LightmapSums sums = lightmap_sums[beside];
            float weight = same_surface(s, other, off) * alike(guide, sums.kept, RANGE) * exp2(-dot(off, off) / 6.0);
            if (weight == 0.0)
                continue;
            light += weight * vec4(sums.all.rgb / sums.all.a, 1.0);
            given += weight * irradiance_to_give(sums);
            variance += weight * weight * sums.kept.a;
            weight *= alike_open(s, other);
            vec3 directions = turned(other.unblocked.xyz, other.normal * models, s.normal * models);
            unblocked += weight * vec4(directions, other.unblocked.w);
            surfaces += weight * other.surfaces;
            rays += weight * other.rays;
        }
    }
    vec3 irradiance = max(mean_irradiance(light), 0.0);
    lightmap_sums[index].filtered = vec4(irradiance, variance / (light.a * light.a));
    s.unblocked = unblocked;
    s.surfaces = surfaces;
    s.rays = rays;
    imageStore(light_image, at, vec4(irradiance, 1.0));
    store_directions(at, s, irradiance);
    store_soft(at, s, max(mean_irradiance(vec4(given, light.a)), 0.0));
}
