// The panorama behind everything, point-sampled where this frame's jitter puts the pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "importance.glsl"
#include "shown_channels.glsl"

layout(location = 0) in vec3 direction_world;
layout(location = 0) out vec4 radiance;

void main()
{
    vec3 sky = panorama_radiance(panorama_from_world(normalize(direction_world)));
    radiance = vec4(PART == PART_ALL ? shown_channels() * sky : vec3(0.0), 1.0);
}
