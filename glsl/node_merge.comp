// Four nodes become one: their light and its moments are added.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "nodes.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const bool ALPHA = false;
layout(set = 0, binding = 0, scalar) buffer Nodes { Node nodes[]; };
layout(set = 0, binding = 1, scalar) buffer Alphas { vec4 alphas[]; };
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
    vec3 flux = vec3(0.0), middle = vec3(0.0);
    vec4 alpha = vec4(0.0);
    mat3 moment = mat3(0.0);
    for (uint i = 0u; i < 4u; ++i) {
        uvec2 at = 2u * id.xy + uvec2(i & 1u, i >> 1);
        uint fine = push.first_fine + (id.z * 2u * push.size + at.y) * 2u * push.size + at.x;
        Node node = nodes[fine];
        flux += node.flux;
        moment += node.moment;
        middle += 0.25 * node.mean;
        if (ALPHA)
            alpha += alphas[fine];
    }
    uint coarse = push.first_coarse + (id.z * push.size + id.y) * push.size + id.x;
    nodes[coarse] = make_node(flux, moment, middle);
    if (ALPHA)
        alphas[coarse] = alpha;
}
