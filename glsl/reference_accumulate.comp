// Adds a frame to each pixel's running mean and sum of squared deviations, and says how far from settled they are:
// Welford, "Note on a Method for Calculating Corrected Sums of Squares and Products" (1962).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "bindings.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(ACCUMULATE_LATEST) uniform sampler2DArray latest;
layout(ACCUMULATE_MEAN, rgba32f) uniform image2DArray mean_radiance;
layout(ACCUMULATE_DEVIATIONS, rgba32f) uniform image2DArray deviations;
// Of one workgroup: the sum and the maximum of its pixels' relative standard errors, and how many pixels have light.
layout(ACCUMULATE_ERRORS, scalar) writeonly buffer Errors { vec3 errors[]; };
layout(push_constant, scalar) uniform Count {
    uvec2 area;  // pixels that were drawn, from the upper left
    uint frames; // this one included
};

shared vec2 relative[64]; // and 1 where there is light

vec2 add(ivec3 at)
{
    vec3 x = texelFetch(latest, at, 0).rgb;
    vec3 mean = vec3(0.0), squares = vec3(0.0);
    if (frames > 1u) {
        mean = imageLoad(mean_radiance, at).rgb;
        squares = imageLoad(deviations, at).rgb;
    }
    vec3 off = x - mean;
    mean += off / float(frames);
    squares += off * (x - mean);
    imageStore(mean_radiance, at, vec4(mean, 1.0));
    imageStore(deviations, at, vec4(squares, 0.0));
    // Channels vary together where samples are shared, so their standard errors add up.
    vec3 standard = sqrt(squares / max(float(frames) * float(frames - 1u), 1.0));
    float light = mean.r + mean.g + mean.b;
    return light > 0.0 ? vec2((standard.r + standard.g + standard.b) / light, 1.0) : vec2(0.0);
}

void main()
{
    ivec3 at = ivec3(gl_GlobalInvocationID);
    relative[gl_LocalInvocationIndex] = all(lessThan(at.xy, ivec2(area))) ? add(at) : vec2(0.0);
    barrier();
    if (gl_LocalInvocationIndex != 0u)
        return;
    vec3 group = vec3(0.0);
    for (uint i = 0u; i < 64u; ++i)
        group = vec3(group.x + relative[i].x, max(group.y, relative[i].x), group.z + relative[i].y);
    uvec3 g = gl_WorkGroupID, n = gl_NumWorkGroups;
    errors[(g.z * n.y + g.y) * n.x + g.x] = group;
}
