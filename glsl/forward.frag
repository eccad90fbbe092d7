// Fragments of whole surfaces; holes, where there is one sample per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "forward.glsl"

void cut_out(float above)
{
    if (above < 0.0)
        discard;
}
