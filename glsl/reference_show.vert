// One triangle over each eye's whole picture.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_shader_viewport_layer_array : require
#include "shared.glsl"

layout(location = 0) flat out int eye;

void main()
{
    eye = gl_InstanceIndex % int(EYES);
    vec2 corner = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2);
    gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);
    gl_Layer = eye;
}
