// Places a vertex of one instance in a shadow map.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "instance.glsl"

layout(push_constant, scalar) uniform Draw {
    mat4 clip_from_models;
    uint instance;
} draw;

layout(location = 0) in vec3 position_local;
layout(location = 1) in vec2 uv_in;

layout(location = 0) out vec2 uv;
layout(location = 1) flat out float alpha_cutoff;

void main()
{
    uv = uv_in;
    alpha_cutoff = materials[instances[draw.instance].material].alpha_cutoff;
    gl_Position = draw.clip_from_models * (instances[draw.instance].world_from_local * vec4(position_local, 1.0));
}
