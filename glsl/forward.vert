// Places a vertex of one instance in one eye's layer.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_shader_viewport_layer_array : require
#include "shared.glsl"
#include "octahedral.glsl"

layout(push_constant) uniform Draw {
    mat4 world_from_local; // rotation, uniform scale, translation
} draw;

layout(location = 0) in vec3 position_local;
layout(location = 1) in vec4 frame_local; // normal and tangent, packed
layout(location = 2) in vec2 uv_in;

// Centroid: at a triangle's edge, attributes taken outside of it give normals that sparkle.
layout(location = 0) centroid out vec3 position_world;
layout(location = 1) centroid out vec3 normal_world;
layout(location = 2) out vec2 uv;
layout(location = 3) centroid out vec4 tangent_world;
layout(location = 4) flat out uint eye;

void main()
{
    eye = gl_InstanceIndex % EYES;
    mat3 turn = mat3(draw.world_from_local);
    vec4 world = draw.world_from_local * vec4(position_local, 1.0);
    position_world = world.xyz;
    normal_world = normalize(turn * frame_normal(frame_local));
    vec4 tangent_local = frame_tangent(frame_local);
    tangent_world = vec4(normalize(turn * tangent_local.xyz), tangent_local.w);
    uv = uv_in;
    gl_Position = frame.eyes[eye].clip_from_world * world;
    gl_Layer = int(eye);
}
