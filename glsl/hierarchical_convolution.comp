// One specular level, or irradiance over pi: radiance around each direction r averaged by the lobe K (lobe.glsl),
//   E(r) = ∫ L(l) K(r.l) dl / ∫ K dl  ≈  Σ flux · mean of K over the node / the same sum where radiance is 1,
// the sum over nodes that cover all of the sphere above the horizon once. Which nodes, precompute::interaction_lists has decided
// for each tile of 8x8 texels: smaller than the lobe is where they lie, so K hardly bends over one, and the bend that is
// left enters by the light's second moment in the node. No sample and no random number: the same light gives the same
// bits. The sums for radiance 1 (NORMS) are the same on every face, and divide out most of what is left of the error.
// Alpha is 1, or (ALPHA) the panorama's averaged by the same lobe; but beside irradiance it is how much of the light is grazing
// (energy.glsl, diffuse_taken).
// Twins: reference::integrals::prefiltered; at alpha = 1 reference::integrals::irradiance over pi and grazing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"
#include "lobe.glsl"
#include "nodes.glsl"

// Texels per invocation, one below the other, so that a node is fetched once for all of them: 8 invocations share an 8x8
// tile.
const uint ROWS = 8;

layout(local_size_x = 8) in;
layout(constant_id = 0) const bool NORMS = false;
layout(constant_id = 1) const bool ALPHA = false;
layout(set = 0, binding = 0, scalar) readonly buffer Nodes { Node nodes[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Lists { uint lists[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Tiles { uvec2 tiles[]; }; // first entry of a list, their number
// Rows of one face, level after level; after irradiance, which is last, those of its grazing light.
layout(set = 0, binding = 3, scalar) buffer Norms { float norms[]; };
layout(set = 0, binding = 4, rgba16f) uniform writeonly image2DArray level;
layout(set = 0, binding = 5, scalar) readonly buffer Alphas { vec4 alphas[]; };
layout(push_constant, scalar) uniform Push {
    float alpha2;
    float k;
    uint first_tile;
    uint first_norm;
    uint first_layer; // of the image
} push;

void main()
{
    uint size = uint(imageSize(level).x);
    uvec3 group = gl_WorkGroupID;
    uint across = gl_NumWorkGroups.x;
    uvec2 corner = 8u * group.xy + uvec2(gl_LocalInvocationID.x, 0u);
    vec3 r[ROWS], sum[ROWS];
    float alpha[ROWS], grazing[ROWS];
    for (uint j = 0u; j < ROWS; ++j) {
        r[j] = cube_direction(group.z, (vec2(corner + uvec2(0u, j)) + 0.5) / float(size));
        sum[j] = vec3(0.0);
        alpha[j] = grazing[j] = 0.0;
    }
    Lobe lobe = Lobe(push.alpha2, push.k);
    uvec2 list = tiles[push.first_tile + (group.z * across + group.y) * across + group.x];
    for (uint i = list.x; i < list.x + list.y; ++i) {
        Node node = nodes[lists[i]];
        vec4 of_alpha = ALPHA ? alphas[lists[i]] : vec4(0.0);
        for (uint j = 0u; j < ROWS; ++j) {
            vec2 weights = lobe_mean(lobe, dot(r[j], node.mean), node.spread);
            sum[j] += weights.x * node.flux + weights.y * (r[j] * node.moment);
            alpha[j] += dot(vec4(weights.y * r[j], weights.x), of_alpha);
        }
    }
    // A loop of its own: specular levels, which are most of the time, must not pay for it.
    bool irradiance = push.alpha2 == 1.0;
    for (uint i = list.x; irradiance && i < list.x + list.y; ++i) {
        Node node = nodes[lists[i]];
        float flux = dot(node.flux, BRIGHTNESS);
        for (uint j = 0u; j < ROWS; ++j)
            grazing[j] += flux * grazing_mean(dot(r[j], node.mean), node.spread);
    }
    for (uint j = 0u; j < ROWS; ++j) {
        uvec2 texel = corner + uvec2(0u, j);
        if (texel.x >= size || texel.y >= size)
            continue;
        uint norm = push.first_norm + texel.y * size + texel.x, grazing_norm = norm + size * size;
        if (NORMS) {
            norms[norm] = sum[j].x;
            if (irradiance)
                norms[grazing_norm] = grazing[j];
            continue;
        }
        vec3 mean = sum[j] / norms[norm];
        float bright = dot(mean, BRIGHTNESS), shown = ALPHA ? clamp(alpha[j] / norms[norm], 0.0, 1.0) : 1.0;
        if (irradiance && bright > 0.0)
            shown = grazing[j] / norms[grazing_norm] / bright;
        imageStore(level, ivec3(texel, push.first_layer + group.z), vec4(round_to_half(mean), shown));
    }
}
