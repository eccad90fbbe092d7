// Samples an array of cubes, for src/gpu/rendering_gpu_tests.rs.
#version 460

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) uniform samplerCubeArray cubes;
layout(set = 0, binding = 1, std430) readonly buffer Directions { vec4 directions[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Results { vec4 results[]; };

void main()
{
    if (gl_GlobalInvocationID.x < directions.length())
        results[gl_GlobalInvocationID.x] = textureLod(cubes, directions[gl_GlobalInvocationID.x], 0.0);
}
