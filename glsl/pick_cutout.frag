// Writes which material is seen, except in holes; 0 is left for nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "holes.glsl"

layout(location = 0) out uint picked;

void main()
{
    if (is_hole())
        discard;
    picked = material_index + 1u;
}
