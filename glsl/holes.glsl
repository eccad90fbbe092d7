// Where surfaces with holes, and those that cover a part of what is behind them, are drawn without light: `placed.vert` before.
#ifndef HOLES_GLSL
#define HOLES_GLSL

#include "shared.glsl"

layout(BASE_COLOR_MAP) uniform sampler2D base_color_map;

layout(location = 0) in vec2 uv;
layout(location = 1) flat in float alpha_cutoff;
layout(location = 2) in float opacity;

// A threshold above 0 and at most 1 for each texel: sixteen different ones in any four by four (Bayer, "An optimum method for
// two-level rendition of continuous-tone pictures" (1973)), which filtered lookups average.
float dither()
{
    uvec2 at = uvec2(gl_FragCoord.xy) & 3u;
    uint x = at.x ^ at.y, y = at.y;
    uint rank = (x & 1u) << 3u | (y & 1u) << 2u | (x >> 1u & 1u) << 1u | (y >> 1u & 1u);
    return (float(rank) + 0.5) / 16.0;
}

bool is_hole()
{
    float alpha = texture(base_color_map, uv).a * opacity;
    return alpha < (alpha_cutoff < 0.0 ? dither() : alpha_cutoff);
}

#endif
