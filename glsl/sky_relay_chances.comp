// The chances of tiles and cells that light is followed from, of how often light from there was seen to come.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "sky_relay.glsl"

layout(local_size_x = 64) in;

layout(SKY_TRIED, scalar) buffer Tries { Tried tries[]; };
layout(SKY_IMPORTANCE, scalar) writeonly buffer Chances {
    uint header[13];
    uint words[];
};
layout(SKY_COMES, scalar) buffer Comes { uint comes[]; }; // of each tile and cell

layout(SKY_SHARES, scalar) buffer Shares { vec2 shares[]; }; // see sky_visibility.comp
layout(push_constant, scalar) uniform Work {
    bool forgets; // begins without any
};

// Part of all indirect light from which on following it is worth its rays.
const float WORTH = 0.3;

shared float totals[TILES];

// Parts of a sum as ends, in whole numbers.
void write_tile(uint tile)
{
    float total = 0.0, sum = 0.0;
    for (uint cell = 0u; cell < RELAY_CELLS; ++cell) {
        if (forgets)
            comes[tile * RELAY_CELLS + cell] = 0u;
        total += float(comes[tile * RELAY_CELLS + cell]);
    }
    for (uint cell = 0u; cell < RELAY_CELLS; ++cell) {
        sum += float(comes[tile * RELAY_CELLS + cell]);
        words[relays_first + RELAY_ENDS + tile * RELAY_CELLS + cell] = end_of(total > 0.0 ? sum / total : 1.0);
    }
    totals[tile] = total;
}

void main()
{
    for (uint tile = gl_LocalInvocationIndex; tile < TILES; tile += 64u)
        write_tile(tile);
    barrier();
    if (gl_LocalInvocationIndex != 0u)
        return;
    float total = 0.0, sum = 0.0;
    for (uint tile = 0u; tile < TILES; ++tile)
        total += totals[tile];
    for (uint tile = 0u; tile < TILES; ++tile) {
        sum += totals[tile];
        words[relays_first + RELAY_TILES + tile] = end_of(total > 0.0 ? sum / total : 1.0);
    }
    vec2 share = vec2(0.0);
    for (uint group = 0u; group < shares.length(); ++group) {
        share += forgets ? vec2(0.0) : shares[group];
        shares[group] = vec2(0.0); // chances are others from now on
    }
    words[relays_first] = share.x > WORTH * share.y ? 1u : 0u;
}
