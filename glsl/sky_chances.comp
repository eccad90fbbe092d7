// The chances of the panorama's tiles at each place, of what rays from there have met so far.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "importance.glsl"

layout(local_size_x = 64) in;

layout(SKY_TRIED, scalar) buffer Tries { Tried tries[]; };
layout(SKY_IMPORTANCE, scalar) writeonly buffer Chances {
    uint header[13];
    uint words[];
};
layout(push_constant, scalar) uniform Work {
    uint places;
    bool forgets; // begins without any rays
};

void main()
{
    // Place 0 is the panorama's own.
    uint place = 1u + gl_GlobalInvocationID.x;
    if (place >= places)
        return;
    float total = 0.0;
    for (uint tile = 0u, begin = 0u; tile < TILES; ++tile) {
        uint end = importance_words[chances_first + tile], i = place * TILES + tile;
        if (forgets)
            tries[i] = Tried(0u, 0u);
        total += chance_of(begin, end) * seen_share(tries[i]);
        begin = end;
    }
    float sum = 0.0;
    for (uint tile = 0u, begin = 0u; tile < TILES; ++tile) {
        uint end = importance_words[chances_first + tile];
        float even = chance_of(begin, end);
        sum += UNLEARNED * even + (1.0 - UNLEARNED) * even * seen_share(tries[place * TILES + tile]) / total;
        // Rounding of the sum must not leave a rest, nor end before the last tile.
        words[chances_first + place * TILES + tile] = end == 0xffffffffu ? end : min(end_of(sum), 0xfffffffeu);
        begin = end;
    }
}
