// The interface's triangles, in points from the upper left corner; indices and vertices lie in the frame's storage.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "bindings.glsl"

layout(push_constant, scalar) uniform Push {
    vec2 ndc_from_points;
    uint first_index; // words
    uint first_vertex;
} push;
layout(FRAME_STORAGE, scalar) readonly buffer Words { uint words[]; };

layout(location = 0) out vec2 uv;
layout(location = 1) out vec4 colour; // sRGB, premultiplied

void main()
{
    // Five words a vertex: position, texture coordinates, colour.
    uint at = push.first_vertex + 5u * words[push.first_index + gl_VertexIndex];
    vec2 position = uintBitsToFloat(uvec2(words[at], words[at + 1u]));
    uv = uintBitsToFloat(uvec2(words[at + 2u], words[at + 3u]));
    colour = unpackUnorm4x8(words[at + 4u]);
    gl_Position = vec4(position * push.ndc_from_points - 1.0, 0.0, 1.0);
}
