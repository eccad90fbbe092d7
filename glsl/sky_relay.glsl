// Light that is followed from the panorama to the first place that it meets: rays of one direction begin on a square beyond the
// scene, its cells by what was learned of where light comes in.
#ifndef SKY_RELAY_GLSL
#define SKY_RELAY_GLSL

#include "importance.glsl"
#include "ray_features.glsl"

// Cells along a side of a tile's square.
const uint RELAY_SIDE = 16;
const uint RELAY_CELLS = RELAY_SIDE * RELAY_SIDE;
// Words: whether there is any, ends of tiles' chances, ends of cells' chances for each tile.
const uint RELAY_TILES = 1;
const uint RELAY_ENDS = RELAY_TILES + TILES;
// Of the sphere around the scene.
float relay_radius()
{
    return 0.5 * length(vec3(places_size)) / places_scale;
}

vec3 relay_centre()
{
    vec3 centre = places_origin + 0.5 * vec3(places_size) / places_scale;
    return (frame.world_from_models * vec4(centre, 1.0)).xyz;
}

bool has_relays()
{
    return rays_have(RAYS_SKY_RELAYS) && cells_size.x > 0u && importance_words[relays_first] != 0u;
}

// The cell of a position, of the square for light from d.
uint relay_cell(vec3 position, vec3 d)
{
    vec2 at = ((position - relay_centre()) * basis(d)).xy / relay_radius();
    uvec2 cell = uvec2(clamp((0.5 * at + 0.5) * float(RELAY_SIDE), vec2(0.0), vec2(RELAY_SIDE - 1u)));
    return cell.y * RELAY_SIDE + cell.x;
}

// Density of light from d and, per area, of the position that it is followed to. `cosine`: of d and the position's normal.
float relay_density(vec3 position, vec3 d, float cosine)
{
    uvec2 sky = sky_cell(panorama_from_world(d));
    uint tile = tile_of(sky);
    float cell_side = 2.0 * relay_radius() / float(RELAY_SIDE);
    return chance_from(relays_first + RELAY_TILES, tile)
        * chance_from(relays_first + RELAY_ENDS + tile * RELAY_CELLS, relay_cell(position, d))
        * uintBitsToFloat(cell_word(sky, CELL_DENSITY)) * max(cosine, 0.0) / (cell_side * cell_side);
}

// Where a ray of light begins, and where to it comes from.
vec3 relay_origin(uvec4 bits, out vec3 d)
{
    uvec4 more = pcg4d(bits);
    uint tile = drawn_end(relays_first + RELAY_TILES, TILES, bits.x);
    uint cell = drawn_end(relays_first + RELAY_ENDS + tile * RELAY_CELLS, RELAY_CELLS, bits.y);
    d = world_from_panorama(tile_direction(tile, more.xyz));
    vec2 at = (vec2(cell % RELAY_SIDE, cell / RELAY_SIDE) + units_from_bits(bits.zw)) / float(RELAY_SIDE);
    return relay_centre() + relay_radius() * (basis(d) * vec3(2.0 * at - 1.0, 1.0));
}

#endif
