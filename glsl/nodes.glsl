// The light of one part of the sphere, and how parts become one; no bindings. The parts are texels of cube maps of
// 1, 2, 4 … texels a side.
#ifndef PBR_VR_NODES
#define PBR_VR_NODES

#extension GL_EXT_scalar_block_layout : require

// Shorter than 1 by as much as the light is spread; where there is no light, any vector does.
struct Node {
    vec3 mean;    // of the directions, weighted by luminance
    float spread; // (1 - |mean|^2) / 4
    vec3 flux;    // integral of radiance over the part
    float unused; // keeps nodes aligned to 16 bytes
};

// How much a colour counts where directions are averaged; the weights add up to 1.
float node_weight(vec3 flux)
{
    return dot(flux, vec3(0.25, 0.5, 0.25));
}

Node make_node(vec3 flux, vec3 weighted_direction, float weight)
{
    vec3 mean = weight > 0.0 ? weighted_direction / weight : vec3(0.0);
    return Node(mean, 0.25 * max(1.0 - dot(mean, mean), 0.0), flux, 0.0);
}

#endif
