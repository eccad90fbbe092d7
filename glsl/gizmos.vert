// Corners of unlit triangles, placed in one eye's layer.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_shader_viewport_layer_array : require
#include "shared.glsl"

// render::GizmoVertex.
struct Vertex {
    vec3 position; // metres, world
    vec3 colour;   // linear display RGB
};

layout(FRAME_STORAGE, scalar) readonly buffer Vertices { Vertex vertices[]; };

layout(location = 0) flat out vec3 colour_display;

void main()
{
    uint eye = gl_InstanceIndex % EYES;
    Vertex corner = vertices[gl_VertexIndex];
    colour_display = corner.colour;
    gl_Position = frame.eyes[eye].clip_from_world * vec4(corner.position, 1.0);
    gl_Layer = int(eye);
}
