// A part of the mirror: one eye's picture, seen by a camera at the same place that may be turned.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "bindings.glsl"

layout(push_constant) uniform Push {
    // The rows of the homography from clip space to texture coordinates; in w: the layer, and the part of the picture along u
    // and v that is drawn.
    vec4 rows[3];
} push;
layout(MIRROR_PICTURE) uniform sampler2DArray picture;
layout(location = 0) in vec2 ndc;
layout(location = 0) out vec4 colour;

// As reference::reprojection::source: Hartley and Zisserman, "Multiple View Geometry" (2004), section 8.4.2. z is not
// above 0 behind the eye.
vec3 source(vec2 at)
{
    vec3 p = vec3(at, 1.0);
    vec3 q = vec3(dot(push.rows[0].xyz, p), dot(push.rows[1].xyz, p), dot(push.rows[2].xyz, p));
    return vec3(q.xy / q.z, q.z);
}

void main()
{
    // Four samples on a rotated grid: the picture may be larger than the window.
    vec2 pixel = vec2(dFdx(ndc.x), dFdy(ndc.y));
    vec2 limit = vec2(push.rows[1].w, push.rows[2].w);
    vec3 centre = source(ndc);
    if (centre.z <= 0.0 || any(lessThan(centre.xy, vec2(0.0))) || any(greaterThan(centre.xy, limit))) {
        discard;
    }
    // Filtering must not read beyond the part that is drawn.
    vec2 half_texel = 0.5 / vec2(textureSize(picture, 0).xy);
    const vec2 offsets[4] =
        vec2[](vec2(-0.125, -0.375), vec2(0.375, -0.125), vec2(0.125, 0.375), vec2(-0.375, 0.125));
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 uv = clamp(source(ndc + offsets[i] * pixel).xy, half_texel, limit - half_texel);
        sum += textureLod(picture, vec3(uv, push.rows[0].w), 0.0).rgb;
    }
    colour = vec4(0.25 * sum, 1.0);
}
