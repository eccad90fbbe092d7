// Which colours a frame of the reference shows of a pixel. Sheets that colour what is behind them let through a part of each colour,
// and fragments either stay or go: where no rays follow what goes through, each frame shows one of the three by chance.
#ifndef SHOWN_CHANNELS_GLSL
#define SHOWN_CHANNELS_GLSL

#include "random.glsl"
#include "ray_features.glsl"
#include "shared.glsl"
#include "transport.glsl"

uint shown_channel()
{
    return min(uint(3.0 * unit_from_bits(pcg4d(uvec4(gl_FragCoord.xy, frame.sample_index, 11u)).x)), 2u);
}

// By which radiance is multiplied.
vec3 shown_channels()
{
    if (TRANSPORT == TRANSPORT_ALL || !rays_have(RAYS_TINTS))
        return vec3(1.0);
    vec3 shown = vec3(0.0);
    shown[shown_channel()] = 3.0;
    return shown;
}

#endif
