// The last step of every shader that writes the picture: radiance, colours and numbers to what the target holds.
// The target encodes sRGB itself, so what is written is linear display light, and samples are averaged in it.
#ifndef PBR_VR_OUTPUT
#define PBR_VR_OUTPUT

#include "shared.glsl"
#include "tone.glsl"

// Scene radiance: exposed and tone-mapped, or as it is.
vec4 display_radiance(vec3 radiance)
{
    return vec4(LINEAR_OUTPUT ? radiance : tone_neutral(radiance * frame.exposure), 1.0);
}

// A reflectance: shown as it is.
vec4 display_colour(vec3 linear)
{
    return vec4(linear, 1.0);
}

// A number in [0, 1]: a picture file holds it as number * 255.
vec4 display_value(vec3 value)
{
    return vec4(LINEAR_OUTPUT ? value : srgb_decode(clamp(value, 0.0, 1.0)), 1.0);
}

#endif
