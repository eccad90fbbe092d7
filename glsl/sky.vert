// One triangle over each eye's whole picture, at infinity.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_shader_viewport_layer_array : require
#include "shared.glsl"

layout(location = 0) out vec3 direction_world;

void main()
{
    uint eye = gl_InstanceIndex % EYES;
    // (0, 0), (2, 0), (0, 2): twice the picture, from its top left.
    vec2 corner = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2);
    vec4 t = frame.eyes[eye].tangents;
    vec3 view = vec3(mix(t.x, t.y, corner.x), mix(t.w, t.z, corner.y), -1.0);
    direction_world = mat3(frame.eyes[eye].world_from_view) * view;
    gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0); // depth 0 is infinity
    gl_Layer = int(eye);
}
