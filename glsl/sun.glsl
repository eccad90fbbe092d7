// The panorama's sun as a light of its own, a disc. Where SUN is false there is none, and nothing here costs anything.
#ifndef SUN_GLSL
#define SUN_GLSL

#include "shared.glsl"
#include "disc.glsl"

// The disc's radiance towards a unit direction in world space, 0 outside of it; W/(m^2 sr).
vec3 sun_radiance(vec3 d)
{
    return SUN && frame.sun.sine > 0.0 && disc_density(d, frame.sun.towards, frame.sun.sine) > 0.0
        ? disc_radiance(frame.sun.irradiance, frame.sun.sine) : vec3(0.0);
}

// The same, averaged over a pixel that is `pixel` radians wide.
vec3 sun_in_pixel(vec3 d, float pixel)
{
    if (!SUN || frame.sun.sine <= 0.0)
        return vec3(0.0);
    float angle = 2.0 * asin(min(0.5 * length(d - frame.sun.towards), 1.0));
    return disc_radiance(frame.sun.irradiance, frame.sun.sine) * disc_coverage(angle, asin(frame.sun.sine), pixel);
}

// A direction to a point of the disc in world space, evenly over its solid angle, for u in [0, 1)^2; only where SUN is true.
vec3 sample_sun(vec2 u)
{
    return sample_disc(u, frame.sun.towards, frame.sun.sine);
}

// Density of `sample_sun` at a unit direction, 1/sr.
float sun_density(vec3 d)
{
    return SUN && frame.sun.sine > 0.0 ? disc_density(d, frame.sun.towards, frame.sun.sine) : 0.0;
}

#endif
