// The panorama as a light to draw samples from, by what of it is seen from a place, and its radiance as it is.
#ifndef PBR_VR_IMPORTANCE
#define PBR_VR_IMPORTANCE

#include "importance_chances.glsl"
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

// Twin of src/reference/importance.rs, which says how cells, tiles and chances hang together; no cells without a table.
layout(RAY_IMPORTANCE, scalar) readonly buffer Importance {
    uvec2 cells_size;
    uint tile_side;     // cells
    uint cells_first;   // in words
    uint chances_first; // in words
    uint relays_first;  // in words: see sky_relay.glsl
    uvec3 places_size;  // of a grid as models stand in the scene, 0 without one: see `sky_place`
    vec3 places_origin;
    float places_scale; // of the grid's steps per metre
    uint importance_words[]; // the grid's places, cells, ends of tiles' chances for each place, relays
};

// Words of a cell.
const uint CELL_WORDS = 3;
const uint CELL_THRESHOLD = 0; // below it the cell itself is taken, else its alias
const uint CELL_ALIAS = 1;     // in the tile, row by row
const uint CELL_DENSITY = 2;   // of the tile's samples in this cell, 1/sr

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

uint tiles_across()
{
    return (cells_size.x + tile_side - 1u) / tile_side;
}

uint cell_word(uvec2 cell, uint which)
{
    return importance_words[cells_first + CELL_WORDS * (cell.y * cells_size.x + cell.x) + which];
}

// Of the places that share chances, that of a point of a surface, on the side that the unit vector is normal to; 0, where the
// panorama alone counts, where there is none.
uint sky_place(vec3 position_world, vec3 side_world)
{
    mat3 turn = mat3(frame.world_from_models);
    vec3 position = (position_world - frame.world_from_models[3].xyz) * turn, side = side_world * turn;
    ivec3 at = ivec3(floor((position - places_origin) * places_scale));
    if (any(lessThan(at, ivec3(0))) || any(greaterThanEqual(at, ivec3(places_size))))
        return 0u;
    vec3 size = abs(side);
    uint axis = size.x >= max(size.y, size.z) ? 0u : size.y >= size.z ? 1u : 2u;
    uint facing = 2u * axis + (side[axis] < 0.0 ? 1u : 0u);
    return importance_words[6u * ((uint(at.z) * places_size.y + uint(at.y)) * places_size.x + uint(at.x)) + facing];
}

// The cell of a direction in the panorama's own frame.
uvec2 sky_cell(vec3 d)
{
    return min(uvec2(panorama_uv(d) * vec2(cells_size)), cells_size - 1u);
}

uint tile_of(uvec2 cell)
{
    uvec2 at = cell / tile_side;
    return at.y * tiles_across() + at.x;
}

// The chance of one of several, whose ends begin at a word.
float chance_from(uint first, uint i)
{
    return chance_of(i > 0u ? importance_words[first + i - 1u] : 0u, importance_words[first + i]);
}

// Density of `sample_panorama` at a direction, 1/sr.
float panorama_density(vec3 d, uint place)
{
    uvec2 cell = sky_cell(d);
    uint tile = tile_of(cell);
    return chance_from(chances_first + place * TILES, tile) * uintBitsToFloat(cell_word(cell, CELL_DENSITY));
}

// Which of so many ends, from a word on, is the first beyond these bits.
uint drawn_end(uint first, uint count, uint bits)
{
    uint low = 0u, high = count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (bits < importance_words[first + middle])
            high = middle;
        else
            low = middle + 1u;
    }
    return low;
}

// A cell by its tile's alias table: Walker, "An Efficient Method for Generating Discrete Random Variables with General
// Distributions" (1977).
uvec2 drawn_cell(uint tile, uint bits)
{
    uvec2 first = tile_side * uvec2(tile % tiles_across(), tile / tiles_across());
    uvec2 size = min(cells_size - first, uvec2(tile_side));
    uint index, low;
    umulExtended(bits, size.x * size.y, index, low);
    uvec2 cell = first + uvec2(index % size.x, index / size.x);
    if (unit_from_bits(low) < uintBitsToFloat(cell_word(cell, CELL_THRESHOLD)))
        return cell;
    uint alias = cell_word(cell, CELL_ALIAS);
    return first + uvec2(alias % size.x, alias / size.x);
}

// A direction of a tile in the panorama's own frame: bits of the cell, and within it.
vec3 tile_direction(uint tile, uvec3 bits)
{
    uvec2 cell = drawn_cell(tile, bits.x);
    float longitude = 2.0 * PI * ((float(cell.x) + unit_from_bits(bits.y)) / float(cells_size.x) - 0.5);
    // cos of the polar angle runs evenly; 1 - cos is kept instead of it, which is exact at the nearer pole.
    bool upper = 2u * cell.y < cells_size.y;
    float row = float(upper ? cell.y : cells_size.y - 1u - cell.y), step_radians = PI / float(cells_size.y);
    float near = sin(0.5 * row * step_radians), far = sin(0.5 * (row + 1.0) * step_radians);
    float half_sine2 = mix(near * near, far * far, unit_from_bits(bits.z));
    float across = 2.0 * sqrt(half_sine2 * (1.0 - half_sine2)), y = 1.0 - 2.0 * half_sine2;
    return vec3(across * cos(longitude), upper ? y : -y, across * sin(longitude));
}

// A direction in the panorama's own frame, even over its cell's solid angle: bits of tile, cell, and within the cell.
vec3 sample_panorama(uvec4 bits, uint place)
{
    return tile_direction(drawn_end(chances_first + place * TILES, TILES, bits.x), bits.yzw);
}

#endif
