// Unlit colours that a viewer sees as they are: no exposure, no tone curve.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "output.glsl"

layout(location = 0) flat in vec3 colour_display;
layout(location = 0) out vec4 colour;

void main()
{
    // Radiance is what the exposure turns into the colour.
    colour = LINEAR_OUTPUT ? vec4(colour_display / frame.exposure, 1.0) : display_colour(colour_display);
}
