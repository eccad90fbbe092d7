// Fills the layers of its targets at a depth each, for src/gpu/rendering_gpu_tests.rs; a slope in depth from left to right.
#version 460
#extension GL_ARB_shader_viewport_layer_array : require

layout(push_constant) uniform Push { float depth; float slope; float depth_step; } push;

void main()
{
    vec2 at = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0;
    gl_Position = vec4(at, push.depth + push.depth_step * float(gl_InstanceIndex) + push.slope * at.x, 1.0);
    gl_Layer = gl_InstanceIndex;
}
