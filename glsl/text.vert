// One quad per character on the grid of text cells.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_ARB_shader_viewport_layer_array : require
#include "bindings.glsl"

layout(constant_id = 0) const uint EYES = 1;
layout(push_constant, scalar) uniform Push {
    vec2 cell_ndc; // a cell's size in clip space
    vec2 origin_ndc;
} push;
layout(FRAME_STORAGE, scalar) readonly buffer Cells { uint cells[]; }; // column, row << 8, character << 16

layout(location = 0) out vec2 in_cell; // font pixels, 0..8 and -1..9: a row of air above and below
layout(location = 1) flat out uint character;

void main()
{
    uint cell = cells[gl_InstanceIndex / EYES];
    vec2 corner = vec2(gl_VertexIndex == 1 || gl_VertexIndex == 2 || gl_VertexIndex == 4,
                       gl_VertexIndex == 2 || gl_VertexIndex == 4 || gl_VertexIndex == 5);
    vec2 at = vec2(cell & 255u, (cell >> 8) & 255u) + corner;
    in_cell = vec2(8.0, 10.0) * corner - vec2(0.0, 1.0);
    character = cell >> 16;
    gl_Position = vec4(push.origin_ndc + at * push.cell_ndc, 0.0, 1.0);
    gl_Layer = int(gl_InstanceIndex % EYES);
}
