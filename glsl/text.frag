// White characters of an 8×8 font on a dark veil.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "bindings.glsl"

layout(TEXT_FONT, scalar) readonly buffer Font { uint font[]; }; // two words a character, a byte a row
layout(location = 0) in vec2 in_cell;
layout(location = 1) flat in uint character;
layout(location = 0) out vec4 colour;

void main()
{
    ivec2 p = ivec2(floor(in_cell));
    bool inside = p.y >= 0 && p.y < 8;
    p = clamp(p, ivec2(0), ivec2(7));
    uint rows = font[2u * min(character, 127u) + uint(p.y) / 4u];
    bool ink = inside && ((rows >> (8 * (p.y % 4) + p.x)) & 1u) != 0u;
    colour = ink ? vec4(1.0) : vec4(0.0, 0.0, 0.0, 0.6);
}
