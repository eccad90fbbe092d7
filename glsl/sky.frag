// The panorama behind everything, and its sun.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "panorama.glsl"
#include "sun.glsl"
#include "output.glsl"

layout(location = 0) in vec3 direction_world;
layout(location = 0) out vec4 colour;

void main()
{
    vec3 d = normalize(direction_world);
    // Texels per pixel from the angle between neighbours: derivatives of u would jump at the seam.
    float radians = max(length(dFdx(d)), length(dFdy(d)));
    float texels = radians * float(textureSize(panorama, 0).y) * INV_PI;
    vec3 sky = sky_radiance(d, log2(max(texels, 1e-6)));
    colour = display_radiance(sky + sun_in_pixel(d, radians));
}
