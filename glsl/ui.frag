// The interface's colours: textures and vertices hold premultiplied sRGB, the attachment blends linear light.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "bindings.glsl"

layout(UI_TEXTURE) uniform sampler2D map;
layout(location = 0) in vec2 uv;
layout(location = 1) in vec4 in_colour;
layout(location = 0) out vec4 colour;

// IEC 61966-2-1.
vec3 linear_from_srgb(vec3 c)
{
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}

void main()
{
    vec4 premultiplied = in_colour * texture(map, uv);
    vec3 straight = premultiplied.rgb / max(premultiplied.a, 1e-4);
    colour = vec4(linear_from_srgb(min(straight, vec3(1.0))), premultiplied.a);
}
