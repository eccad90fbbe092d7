// Rays through a scene's bounding volume hierarchy: Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs
// Through Compressed Wide BVHs" (2017). Twin of src/scene/bvh.rs, which says how nodes and triangles lie in their buffers.
// The file that includes this one says which hits count, in `is_hole`.
#ifndef BVH_GLSL
#define BVH_GLSL

#extension GL_EXT_scalar_block_layout : require
#include "bindings.glsl"
#include "math.glsl"
#include "ray_features.glsl"

struct BvhNode {
    vec3 origin;
    uint exponents_and_inner; // of x, y, z, and a bit for each child that is a node
    uint first_child;
    uint first_triangle;
    uvec2 meta;
    uvec2 low_x, high_x, low_y, high_y, low_z, high_z; // a byte for each child
};

struct BvhTriangle {
    vec3 a, b, c; // metres, as the models stand in the scene
    uint material_and_flags;
};

// Both in vectors of four where they can be: Mesa's renderer on a CPU reads a buffer by a loop over its lanes for each access.
const uint NODE_VECTORS = 5;
struct BvhTriangleWords { uvec4 first, second; uvec2 third; };
layout(RAY_NODES, std430) readonly buffer BvhNodes { uvec4 bvh_node_vectors[]; };
layout(RAY_TRIANGLES, scalar) readonly buffer BvhTriangles { BvhTriangleWords bvh_triangle_words[]; };

BvhNode bvh_node(uint index)
{
    uint at = NODE_VECTORS * index;
    uvec4 a = bvh_node_vectors[at], b = bvh_node_vectors[at + 1u], x = bvh_node_vectors[at + 2u];
    uvec4 y = bvh_node_vectors[at + 3u], z = bvh_node_vectors[at + 4u];
    return BvhNode(uintBitsToFloat(a.xyz), a.w, b.x, b.y, b.zw, x.xy, x.zw, y.xy, y.zw, z.xy, z.zw);
}

BvhTriangle bvh_triangle(uint index)
{
    BvhTriangleWords words = bvh_triangle_words[index];
    return BvhTriangle(uintBitsToFloat(words.first.xyz), uintBitsToFloat(uvec3(words.first.w, words.second.xy)),
        uintBitsToFloat(uvec3(words.second.zw, words.third.x)), words.third.y);
}

// The upper bits of `material_and_flags`: the material is alpha-tested; no path from a camera meets the
// triangle's back, as that of a closed surface; it is part of a sphere light.
const uint BVH_MASKED = 0x80000000u;
const uint BVH_ONE_SIDED = 0x40000000u;
const uint BVH_SPHERE = 0x20000000u;
const uint BVH_MATERIAL = 0x1fffffffu;
// The same as scene::bvh::STACK, which the tree's depth is checked against.
const uint BVH_STACK = 32;
// Slack for rounding, six units in the last place: Ize, "Robust BVH Ray Traversal" (2013), for boxes of bytes.
const float BVH_SLACK = 3.6e-7;

// Part of a triangle's height by which it is larger for rays.
const float EDGE_SLACK = 1e-6;

struct RayHit {
    float t; // in lengths of the direction
    uint triangle;
    vec3 weights; // of a, b, c; their sum is 1
    vec3 transmission; // by which holes before it, or all of them if nothing was met, multiply light
};

// The normal of a triangle, not of unit length: away from its back.
vec3 bvh_normal(uint index)
{
    BvhTriangle triangle = bvh_triangle(index);
    return cross(triangle.b - triangle.a, triangle.c - triangle.a);
}

// The index of its material.
uint bvh_material(uint triangle)
{
    return bvh_triangle(triangle).material_and_flags & BVH_MATERIAL;
}

bool is_masked(uint triangle)
{
    return rays_have(RAYS_HOLES) && (bvh_triangle(triangle).material_and_flags & BVH_MASKED) != 0u;
}

// Whether a hit on an alpha-tested triangle, by a ray at this cosine to its normal, is in a hole, and by which that multiplies
// light that goes through.
bool is_hole(RayHit hit, float cosine, out vec3 through);

// Reciprocals that stay finite: a ray along an axis still has a sign on the other two.
vec3 bvh_inverse(vec3 d)
{
    vec3 least = vec3(1e-18);
    return 1.0 / mix(d, mix(least, -least, lessThan(d, vec3(0.0))), lessThan(abs(d), least));
}

vec4 bvh_bytes(uint four)
{
    return vec4(uvec4(four, four >> 8u, four >> 16u, four >> 24u) & 0xffu);
}

// Bits of the children that the ray meets before t: leaves' triangles in bits 0 to 23, nodes in 24 to 31, nearest highest.
uint bvh_children(BvhNode node, vec3 o, vec3 inverse, float t, uint octant)
{
    uint e = node.exponents_and_inner;
    vec3 scale = uintBitsToFloat(uvec3(e << 23u, e << 15u, e << 7u) & 0x7f800000u) * inverse;
    vec3 start = (node.origin - o) * inverse;
    vec3 near = start - BVH_SLACK * abs(start), far = start + BVH_SLACK * abs(start);
    bvec3 backwards = lessThan(inverse, vec3(0.0));
    uvec2 near_x = backwards.x ? node.high_x : node.low_x, far_x = backwards.x ? node.low_x : node.high_x;
    uvec2 near_y = backwards.y ? node.high_y : node.low_y, far_y = backwards.y ? node.low_y : node.high_y;
    uvec2 near_z = backwards.z ? node.high_z : node.low_z, far_z = backwards.z ? node.low_z : node.high_z;
    uint hits = 0u;
    for (uint half_of = 0u; half_of < 2u; ++half_of) {
        vec4 enter = max(max(bvh_bytes(near_x[half_of]) * scale.x + near.x, bvh_bytes(near_y[half_of]) * scale.y + near.y),
            max(bvh_bytes(near_z[half_of]) * scale.z + near.z, vec4(0.0)));
        vec4 leave = min(min(bvh_bytes(far_x[half_of]) * scale.x + far.x, bvh_bytes(far_y[half_of]) * scale.y + far.y),
            min(bvh_bytes(far_z[half_of]) * scale.z + far.z, vec4(t)));
        bvec4 met = lessThanEqual(enter, leave * (1.0 + BVH_SLACK));
        uint metas = node.meta[half_of];
        for (uint child = 0u; child < 4u; ++child) {
            uint meta = (metas >> (8u * child)) & 0xffu, place = meta & 31u;
            bool inner = place >= 24u;
            if (met[child])
                hits |= (meta >> 5u) << (inner ? place ^ octant : place);
        }
    }
    return hits;
}

// The point where the ray meets a triangle, with t below 0 if it does not: from the volumes that the direction spans with
// each edge (Plücker coordinates). Sums and differences of corners lose fewer digits than their products, neighbours get the
// same volume for their edge, and the slack closes the gaps at corners: no ray passes between neighbours.
RayHit bvh_meet(uint index, vec3 o, vec3 d)
{
    BvhTriangle triangle = bvh_triangle(index);
    precise vec3 a = triangle.a - o, b = triangle.b - o, c = triangle.c - o;
    precise vec3 volumes =
        vec3(dot(cross(c - b, c + b), d), dot(cross(a - c, a + c), d), dot(cross(b - a, b + a), d));
    float sum = volumes.x + volumes.y + volumes.z;
    RayHit hit = RayHit(-1.0, index, volumes / sum, vec3(1.0));
    if (sum != 0.0 && min(hit.weights.x, min(hit.weights.y, hit.weights.z)) >= -EDGE_SLACK)
        hit.t = dot(hit.weights.x * a + hit.weights.y * b + hit.weights.z * c, d) / dot(d, d);
    return hit;
}

// Of a ray to the normal of the triangle that it met, on either side.
float bvh_cosine(RayHit hit, vec3 d)
{
    return abs(dot(normalize_or(bvh_normal(hit.triangle), vec3(0.0)), d)) * inversesqrt(dot(d, d));
}

// The nearest hit before t, or with `any` some hit; t below 0 for none.
RayHit bvh_trace(vec3 o, vec3 d, float t, bool any)
{
    vec3 inverse = bvh_inverse(d);
    uvec3 forwards = uvec3(greaterThanEqual(inverse, vec3(0.0)));
    uint octant = 4u * forwards.x + 2u * forwards.y + forwards.z;
    RayHit nearest = RayHit(-1.0, 0u, vec3(0.0), vec3(1.0));
    vec3 transmission = vec3(1.0);
    float tinted = -1.0; // where the farthest hole of a sheet is
    uvec2 stack[BVH_STACK];
    uint top = 0u;
    // Of nodes: the first one, and the bits of those met with the bits of which children are nodes.
    uvec2 group = uvec2(0u, 0x80000000u);
    while (true) {
        uint highest = uint(findMSB(group.y));
        group.y &= ~(1u << highest);
        if (group.y > 0x00ffffffu)
            stack[top++] = group;
        uint slot = (highest - 24u) ^ octant;
        BvhNode node = bvh_node(group.x + uint(bitCount(group.y & 0xffu & ~(0xffffffffu << slot))));
        uint hits = bvh_children(node, o, inverse, t, octant);
        group = uvec2(node.first_child, (hits & 0xff000000u) | (node.exponents_and_inner >> 24u));
        for (uint triangles = hits & 0x00ffffffu; triangles != 0u;) {
            uint bit = uint(findMSB(triangles));
            triangles &= ~(1u << bit);
            RayHit hit = bvh_meet(node.first_triangle + bit, o, d);
            if (hit.t < 0.0 || hit.t >= t)
                continue;
            vec3 through;
            if (is_masked(hit.triangle) && is_hole(hit, bvh_cosine(hit, d), through)) {
                if (rays_have(RAYS_TINTS)) {
                    transmission *= through;
                    tinted = max(tinted, hit.t);
                }
                continue;
            }
            nearest = hit;
            if (any)
                return nearest;
            t = hit.t;
        }
        if (group.y <= 0x00ffffffu) {
            if (top == 0u) {
                nearest.transmission = transmission;
                if (!rays_have(RAYS_TINTS) || nearest.t < 0.0 || tinted <= nearest.t)
                    return nearest;
                // Sheets behind the hit were looked through, too: once more, up to the hit.
                transmission = vec3(1.0);
                tinted = -1.0;
                group = uvec2(0u, 0x80000000u);
            } else {
                group = stack[--top];
            }
        }
    }
}

#endif
