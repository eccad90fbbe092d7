// White characters of an 8×8 font on a dark veil.
#version 460
#extension GL_EXT_scalar_block_layout : require

layout(set = 0, binding = 1, scalar) readonly buffer Font { uint font[]; }; // two words a character, a byte a row
layout(location = 0) in vec2 in_cell;
layout(location = 1) flat in uint character;
layout(location = 0) out vec4 colour;

void main()
{
    uvec2 p = min(uvec2(in_cell), uvec2(7u));
    uint rows = font[2u * min(character, 127u) + p.y / 4u];
    bool ink = ((rows >> (8u * (p.y % 4u) + p.x)) & 1u) != 0u;
    colour = ink ? vec4(1.0) : vec4(0.0, 0.0, 0.0, 0.6);
}
