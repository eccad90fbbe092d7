// Writes other numbers into each of two targets, for src/gpu/rendering_gpu_tests.rs.
#version 460

layout(location = 0) out vec4 first;
layout(location = 1) out vec4 second;

void main()
{
    first = vec4(1.0, 2.0, 3.0, 4.0);
    second = vec4(0.25, 0.5, 0.75, 1.0);
}
