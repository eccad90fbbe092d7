// Texels that may share their light: those beside each other on one surface.
#ifndef LIGHTMAP_BESIDE_GLSL
#define LIGHTMAP_BESIDE_GLSL

#include "lightmap.glsl"

// The index of a texel that is seen and has samples, or NO_TEXEL.
uint texel_at(ivec3 at)
{
    ivec2 size = imageSize(light_image).xy;
    if (any(lessThan(at.xy, ivec2(0))) || any(greaterThanEqual(at.xy, size)))
        return NO_TEXEL;
    uint index = lightmap_indices[(at.z * size.y + at.y) * size.x + at.x];
    return index != NO_TEXEL && lightmap_sums[index].all.a > 0.0 ? index : NO_TEXEL;
}

// How far two texels are on one smooth surface, 0 to 1, with `off` texels from one to the other in the atlas.
float same_surface(LightmapSurface a, LightmapSurface b, vec2 off)
{
    vec3 apart = b.place - a.place;
    // Charts are stretched by up to a factor of two.
    float most = 2.0 * a.extent * (length(off) + 1.0);
    float squared = dot(apart, apart), along_normal = max(abs(dot(apart, a.normal)), abs(dot(apart, b.normal)));
    if (squared > most * most || along_normal > 0.25 * sqrt(squared) + 0.05 * a.extent)
        return 0.0;
    return smoothstep(0.9, 1.0, dot(a.normal, b.normal));
}

// Part of the light by which texels may differ where there is no noise.
const float LEAST_RANGE = 0.002;

// How likely it is noise alone that two texels differ by, 0 to 1, whose irradiance and its variance are known; `range`: by how much
// the squares of what is compared may differ, of the variance of both. That of the one with less noise counts for both: a shadow beside
// noisy light is no noise.
float alike(vec4 known, vec4 other, float range)
{
    float apart = brightness(known.rgb - other.rgb), least = LEAST_RANGE * brightness(known.rgb);
    return exp(-apart * apart / max(2.0 * range * min(known.a, other.a) + least * least, TINY));
}

#endif
