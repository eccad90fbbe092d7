// What a lightmap knows of mirror images, of the sky or of the walls that a probe shows: how much of one a surface sees in a
// direction, by a linear fit, and the most light it can be. Twin of src/reference/openness.rs; no bindings.
#ifndef OPENNESS_GLSL
#define OPENNESS_GLSL

#include "math.glsl"

// Visibility along a unit direction d before it is made steeper: even + dot(slope, d).
struct Openness {
    vec3 slope;
    float even;
};

// `mean`: of directions drawn by the cosine around n, those that nothing blocks, with 0 for all others. Across n this is the
// least-squares fit; along n the mean leaves one number open, and what blocks is taken to stand at the horizon first.
Openness openness_from_mean(vec3 n, vec3 mean)
{
    float along = dot(mean, n), even = clamp(6.0 * along - 3.0, 0.0, 1.0);
    float slope_along = along > 0.5 ? 1.0 - even : 2.0 * along;
    return Openness(4.0 * mean + (slope_along - 4.0 * along) * n, even);
}

// A line through a step, as where a floor ends the sky, has a slope of 0.85: what comes near to that is taken for one.
float visibility(Openness open, vec3 d)
{
    float steeper = 1.0 + 2.0 * smoothstep(0.4, 0.85, length(open.slope));
    return clamp(0.5 + steeper * (open.even + dot(open.slope, d) - 0.5), 0.0, 1.0);
}

// The most radiance that a lobe can come to where all irradiance is known, in units of that over pi: as if it were even over a cap
// with the lobe's mean vector, 1 - spread long and at this cosine to the normal, and nothing came from elsewhere.
float most_radiance(float spread, float cosine)
{
    return 1.0 / max(4.0 * spread * (1.0 - spread) * cosine, TINY);
}

// A GGX lobe's peak over the mean of such a cap: 4 at a roughness of 0.4, and more for smoother ones.
const float LOBE_PEAK = 4.0;

// What bounds an image, of which this part is the panorama's, by the irradiance that there is and by what it would be if nothing
// blocked the panorama, both over pi: all of it comes from the cap; or else what is blocked was at the lobe's peak, and the rest of
// the panorama is there. `most`: see above.
vec3 image_bound(vec3 panorama, vec3 over_pi, vec3 open_over_pi, float most)
{
    return max(over_pi * most, panorama - max(open_over_pi - over_pi, 0.0) * (LOBE_PEAK * most));
}

#endif
