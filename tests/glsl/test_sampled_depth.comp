// Samples a layered depth image at points, as it is and compared, for src/gpu/rendering_gpu_tests.rs.
#version 460

struct Point { vec2 uv; float layer; float reference; };

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) uniform sampler2DArray depths;
layout(set = 0, binding = 1) uniform sampler2DArrayShadow shadows;
layout(set = 0, binding = 2, std430) readonly buffer Points { Point points[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Results { vec2 results[]; };

void main()
{
    if (gl_GlobalInvocationID.x >= points.length())
        return;
    Point p = points[gl_GlobalInvocationID.x];
    float stored = textureLod(depths, vec3(p.uv, p.layer), 0.0).r;
    results[gl_GlobalInvocationID.x] = vec2(stored, texture(shadows, vec4(p.uv, p.layer, p.reference)));
}
