// Reduces the textures of one material to one layer for rays.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "bindings.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(BASE_COLOR_MAP) uniform sampler2D base_color_map;
layout(NORMAL_MAP) uniform sampler2D normal_map;
layout(ORM_MAP) uniform sampler2D orm_map;
layout(EMISSION_MAP) uniform sampler2D emission_map;
layout(EXTENSION_MAP) uniform sampler2D extension_map;
layout(RAY_TEXTURES_BASE_COLOR, rgba16f) uniform writeonly image2DArray base_color;
layout(RAY_TEXTURES_NORMAL, rgba8) uniform writeonly image2DArray normal;
layout(RAY_TEXTURES_ORM, rgba8) uniform writeonly image2DArray orm;
layout(RAY_TEXTURES_EMISSION, rgba16f) uniform writeonly image2DArray emission; // one texel where there are no maps; or extension
layout(push_constant) uniform Target {
    uint layer;
    uint is_extension; // 1: no others are written
} target;

// The mean over a texel of the layer, or nearly.
vec4 reduced(sampler2D map, vec2 at, ivec2 size)
{
    vec2 texels = vec2(textureSize(map, 0)) / vec2(size);
    return textureLod(map, at, log2(max(max(texels.x, texels.y), 1.0)));
}

void main()
{
    bool is_extension = target.is_extension != 0u;
    ivec2 size = is_extension ? imageSize(emission).xy : imageSize(base_color).xy;
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, uvec2(size))))
        return;
    ivec3 texel = ivec3(gl_GlobalInvocationID.xy, target.layer);
    vec2 at = (vec2(texel.xy) + 0.5) / vec2(size);
    if (is_extension) {
        imageStore(emission, texel, reduced(extension_map, at, size));
        return;
    }
    imageStore(base_color, texel, reduced(base_color_map, at, size));
    imageStore(normal, texel, reduced(normal_map, at, size));
    imageStore(orm, texel, reduced(orm_map, at, size));
    if (all(lessThan(texel.xy, imageSize(emission).xy)))
        imageStore(emission, texel, reduced(emission_map, at, size));
}
