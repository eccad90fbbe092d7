// Places a triangle of what the lenses hide in its eye's layer, at the near plane.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_shader_viewport_layer_array : require

layout(location = 0) in vec3 corner; // x and y of clip space, eye

void main()
{
    gl_Position = vec4(corner.xy, 1.0, 1.0); // reversed depth: 1 is nearest
    gl_Layer = int(corner.z);
}
