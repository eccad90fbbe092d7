// The panorama as a light to draw samples from: an alias table over cells, and its radiance as it is.
#ifndef PBR_VR_IMPORTANCE
#define PBR_VR_IMPORTANCE

#include "panorama.glsl"
#include "sampling.glsl"
#include "sun.glsl"
#include "random.glsl"

// What of a surface's light is shown, the order of render::LightPart.
layout(constant_id = 18) const uint PART = 0;
const uint PART_ALL = 0; // and the sky
const uint PART_DIRECT = 1; // straight from lamps and the sun
const uint PART_SOFT_DIFFUSE = 2; // of all other light
const uint PART_SOFT_SPECULAR = 3;

// Same as reference::importance::Cell.
struct Cell {
    float threshold; // below it the cell itself is taken, else its alias
    uint alias;
    float density;   // of samples in this cell, 1/sr
};
layout(RAY_IMPORTANCE, scalar) readonly buffer Importance {
    uvec2 cells_size;
    Cell cells[];
};

// The panorama with its sun. Bilinear between texel centres, round the seam, clamped at the poles, in f32: samplers round the
// weights to 8 bits.
vec3 panorama_radiance(vec3 d)
{
    ivec2 size = textureSize(panorama, 0);
    vec2 at = panorama_uv(d) * vec2(size) - 0.5;
    vec2 base = floor(at), part = at - base;
    ivec2 lo = ivec2(base), hi = lo + 1;
    lo.x = (lo.x + size.x) % size.x;
    hi.x = hi.x % size.x;
    ivec2 rows = clamp(ivec2(lo.y, hi.y), 0, size.y - 1);
    vec3 upper = mix(texelFetch(panorama, ivec2(lo.x, rows.x), 0).rgb, texelFetch(panorama, ivec2(hi.x, rows.x), 0).rgb, part.x);
    vec3 lower = mix(texelFetch(panorama, ivec2(lo.x, rows.y), 0).rgb, texelFetch(panorama, ivec2(hi.x, rows.y), 0).rgb, part.x);
    return mix(upper, lower, part.y) + (SUN ? sun_radiance(world_from_panorama(d)) : vec3(0.0));
}

// Density of `sample_panorama` at a direction, 1/sr.
float panorama_density(vec3 d)
{
    uvec2 cell = min(uvec2(panorama_uv(d) * vec2(cells_size)), cells_size - 1u);
    return cells[cell.y * cells_size.x + cell.x].density;
}

// A direction in the panorama's own frame: Walker, "An Efficient Method for Generating Discrete Random Variables with
// General Distributions" (1977); even over the cell's solid angle.
vec3 sample_panorama(uvec4 bits)
{
    uint index, low;
    umulExtended(bits.x, cells_size.x * cells_size.y, index, low);
    if (unit_from_bits(bits.y) >= cells[index].threshold)
        index = cells[index].alias;
    uvec2 cell = uvec2(index % cells_size.x, index / cells_size.x);
    float longitude = 2.0 * PI * ((float(cell.x) + unit_from_bits(bits.z)) / float(cells_size.x) - 0.5);
    // cos of the polar angle runs evenly; 1 - cos is kept instead of it, which is exact at the nearer pole.
    bool upper = 2u * cell.y < cells_size.y;
    float row = float(upper ? cell.y : cells_size.y - 1u - cell.y), step_radians = PI / float(cells_size.y);
    float near = sin(0.5 * row * step_radians), far = sin(0.5 * (row + 1.0) * step_radians);
    float half_sine2 = mix(near * near, far * far, unit_from_bits(bits.w));
    float across = 2.0 * sqrt(half_sine2 * (1.0 - half_sine2)), y = 1.0 - 2.0 * half_sine2;
    return vec3(across * cos(longitude), upper ? y : -y, across * sin(longitude));
}

#endif
