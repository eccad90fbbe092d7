// The light of one part of the sphere, and how parts become one; no bindings. The parts are texels of cube maps of
// 1, 2, 4 … texels a side.
#ifndef PBR_VR_NODES
#define PBR_VR_NODES

#extension GL_EXT_scalar_block_layout : require

// Scalar layout: 64 bytes.
struct Node {
    vec3 mean;    // of the directions, weighted by brightness; shorter than 1 by as much as the light is spread
    float spread; // (1 - |mean|^2) / 4
    vec3 flux;    // integral of radiance over the part
    mat3 moment;  // integral of radiance times direction; a column for each channel
};

// How much a colour counts where directions are averaged; the weights add up to 1.
const vec3 BRIGHTNESS = vec3(0.25, 0.5, 0.25);

// Where alpha is filtered, too, a part has a vec4 beside its node: the integrals of alpha times direction, and of alpha.

// `middle`: a mean of the directions where there is no light.
Node make_node(vec3 flux, mat3 moment, vec3 middle)
{
    float weight = dot(flux, BRIGHTNESS);
    vec3 mean = weight > 0.0 ? moment * BRIGHTNESS / weight : middle;
    return Node(mean, 0.25 * max(1.0 - dot(mean, mean), 0.0), flux, moment);
}

#endif
