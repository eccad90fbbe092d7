// The accumulated mean as a picture.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "output.glsl"

layout(location = 0) flat in int eye;
layout(location = 0) out vec4 colour;
layout(SHOW_MEAN) uniform sampler2DArray mean_radiance;

void main()
{
    colour = display_radiance(texelFetch(mean_radiance, ivec3(gl_FragCoord.xy, eye), 0).rgb);
}
