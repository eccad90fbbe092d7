// Leaves holes in shadows of surfaces with holes, and of those that cover a part of what is behind them that part of the texels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "holes.glsl"

void main()
{
    if (is_hole())
        discard;
}
