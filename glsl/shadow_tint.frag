// By which a sheet multiplies the light that goes through it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "holes.glsl"

layout(location = 0) out vec4 through;

void main()
{
    Material material = materials[material_index];
    vec4 factors = texture(base_color_map, uv);
    through = vec4((1.0 - coverage(factors, material)) * material.transmission * factors.rgb, 1.0);
}
