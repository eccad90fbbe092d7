// Sums numbers from both bindings of a frame's arena, for src/gpu/frame_ring.rs.
#version 460

layout(local_size_x = 1) in;
layout(set = 0, binding = 0) uniform Uniform { uvec4 numbers; } from_uniform;
layout(set = 0, binding = 1, std430) readonly buffer Storage { uint numbers[]; } from_storage;
layout(set = 1, binding = 0, std430) writeonly buffer Sum { uint sum; } to;

void main()
{
    uvec4 u = from_uniform.numbers;
    to.sum = u.x + u.y + from_storage.numbers[0] + from_storage.numbers[1];
}
