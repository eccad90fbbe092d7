// Leaves holes in shadows of surfaces with holes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(BASE_COLOR_MAP) uniform sampler2D base_color_map;

layout(location = 0) in vec2 uv;
layout(location = 1) flat in float alpha_cutoff;

void main()
{
    if (texture(base_color_map, uv).a < alpha_cutoff)
        discard;
}
