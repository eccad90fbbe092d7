// The panorama as it is seen from the world, without its sun.
#ifndef PBR_VR_PANORAMA
#define PBR_VR_PANORAMA

#include "shared.glsl"
#include "cube.glsl"

// World direction to the frame that the panorama was stored in.
vec3 panorama_from_world(vec3 d)
{
    return rotate_y(d, vec2(frame.environment_rotation.x, -frame.environment_rotation.y));
}

vec3 world_from_panorama(vec3 d)
{
    return rotate_y(d, frame.environment_rotation);
}

// Radiance along a unit world direction, from one mip.
vec3 sky_radiance(vec3 d, float lod)
{
    return textureLod(panorama, panorama_uv(panorama_from_world(d)), lod).rgb;
}

// The mip in which the panorama is so many texels wide: what lies between samples so far apart is averaged.
float panorama_lod(float texels_across)
{
    return max(log2(float(textureSize(panorama, 0).x) / texels_across), 0.0);
}

#endif
