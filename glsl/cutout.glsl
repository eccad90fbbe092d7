// Fragments of surfaces with holes, whose edges are as smooth as those of triangles: each of a pixel's four samples is there
// or not by its own alpha, which is taken to change evenly across the pixel.
#include "forward.glsl"

// From the pixel's centre: Vulkan's standard sample locations.
const vec2 SAMPLES[4] = vec2[](vec2(-0.125, -0.375), vec2(0.375, -0.125), vec2(-0.375, 0.125), vec2(0.125, 0.375));

void cut_out(float above)
{
    vec2 slope = vec2(dFdx(above), dFdy(above));
    int covered = 0;
    for (int i = 0; i < 4; ++i)
        covered |= int(above + dot(slope, SAMPLES[i]) >= 0.0) << i;
    if (covered == 0)
        discard;
    gl_SampleMask[0] = covered;
}
