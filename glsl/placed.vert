// Places a vertex of one instance in a shadow map, or in a target that tells materials apart.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "instance.glsl"
#include "placed.glsl"

layout(location = 0) in vec3 position_local;
layout(location = 1) in vec2 uv_in;

layout(location = 0) out vec2 uv;
layout(location = 1) flat out float alpha_cutoff; // below 0: alpha is coverage
layout(location = 2) out float opacity;
layout(location = 3) flat out uint material_index;
layout(location = 4) out vec3 position_models;

void main()
{
    material_index = instances[draw.instance].material;
    Material material = materials[material_index];
    bool is_second = (material.flags & MATERIAL_SECOND_UV << MAP_BASE_COLOR) != 0u;
    uv = is_second ? vertex_extras[gl_VertexIndex].uv1 : uv_in;
    alpha_cutoff = (material.flags & MATERIAL_BLENDS) != 0u ? -1.0 : material.alpha_cutoff;
    bool is_coloured = (material.flags & MATERIAL_VERTEX_COLOURS) != 0u;
    opacity = material.opacity * (is_coloured ? unpacked_colour(vertex_extras[gl_VertexIndex]).a : 1.0);
    vec4 position = instances[draw.instance].world_from_local * vec4(position_local, 1.0);
    position_models = position.xyz;
    gl_Position = draw.clip_from_models * position;
}
