// Four nodes become one: their light and its moments are added.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "nodes.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, scalar) buffer Nodes { Node nodes[]; };
// Nodes are stored as index = first + (face * size + y) * size + x.
layout(push_constant) uniform Push {
    uint first_fine;
    uint first_coarse;
    uint size; // of the coarse faces
} push;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    if (id.x >= push.size || id.y >= push.size)
        return;
    vec4 flux = vec4(0.0);
    vec3 middle = vec3(0.0);
    mat4x3 moment = mat4x3(0.0);
    for (uint i = 0u; i < 4u; ++i) {
        uvec2 at = 2u * id.xy + uvec2(i & 1u, i >> 1);
        Node node = nodes[push.first_fine + (id.z * 2u * push.size + at.y) * 2u * push.size + at.x];
        flux += node.flux;
        middle += 0.25 * node.mean;
        moment += node.moment;
    }
    nodes[push.first_coarse + (id.z * push.size + id.y) * push.size + id.x] = make_node(flux, moment, middle);
}
