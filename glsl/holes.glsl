// Where surfaces with holes, and those that cover a part of what is behind them, are drawn without light: `placed.vert` before.
#ifndef HOLES_GLSL
#define HOLES_GLSL

#include "brdf.glsl"
#include "instance.glsl"
#include "math.glsl"
#include "placed.glsl"

layout(BASE_COLOR_MAP) uniform sampler2D base_color_map;

layout(location = 0) in vec2 uv;
layout(location = 1) flat in float alpha_cutoff;
layout(location = 2) in float opacity;
layout(location = 3) flat in uint material_index;
layout(location = 4) in vec3 position_models;

// A threshold above 0 and at most 1 for each texel: sixteen different ones in any four by four (Bayer, "An optimum method for
// two-level rendition of continuous-tone pictures" (1973)), which filtered lookups average.
float dither()
{
    uvec2 at = uvec2(gl_FragCoord.xy) & 3u;
    uint x = at.x ^ at.y, y = at.y;
    uint rank = (x & 1u) << 3u | (y & 1u) << 2u | (x >> 1u & 1u) << 1u | (y >> 1u & 1u);
    return (float(rank) + 0.5) / 16.0;
}

// Alpha of the fragment. A sheet's is more where light goes through it at a slant.
float coverage(vec4 factors, Material material)
{
    float alpha = opacity * factors.a;
    if ((material.flags & MATERIAL_TRANSMITS) == 0u)
        return alpha;
    // The view ray's points lie on two planes, those of the fragment's column and of its row.
    mat4 rows = transpose(draw.clip_from_models);
    vec4 clip = draw.clip_from_models * vec4(position_models, 1.0);
    vec3 ray = cross(rows[0].xyz - clip.x / clip.w * rows[3].xyz, rows[1].xyz - clip.y / clip.w * rows[3].xyz);
    vec3 n = normalize_or(cross(dFdx(position_models), dFdy(position_models)), vec3(0.0));
    return slanted_coverage(alpha, abs(dot(normalize_or(ray, vec3(0.0)), n)));
}

bool is_hole()
{
    vec4 factors = texture(base_color_map, uv);
    float alpha = coverage(factors, materials[material_index]);
    return alpha < (alpha_cutoff < 0.0 ? dither() : alpha_cutoff);
}

#endif
