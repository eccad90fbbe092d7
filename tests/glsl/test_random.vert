// One pixel per triangle, its surface made of random and of hostile numbers, for src/render/random_gpu_tests.rs: what
// forward.vert hands over, but from hashes of the pixel and of the corner.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "instance.glsl"

layout(push_constant, scalar) uniform Range {
    uint instance;
    uint first;      // pixel of the first triangle
    uint seed;
    uint hostile;    // of 256 corners' vectors, so many are hostile
    uint inside;     // 1: some surfaces lie in a point light or in the eye
    uvec2 size;      // of the picture, pixels
} range;

layout(location = 0) centroid out vec4 covered_position;
layout(location = 1) centroid out vec3 normal_world;
layout(location = 2) out vec2 uv;
layout(location = 3) centroid out vec4 tangent_world;
layout(location = 4) flat out uint eye;
layout(location = 5) flat out vec4 base_color_metallic;
layout(location = 6) flat out vec4 surface_factors;
layout(location = 7) out vec3 position_centre;
layout(location = 8) centroid out vec2 covered_lightmap_uv;
layout(location = 9) centroid out vec4 vertex_colour;
layout(location = 10) out vec2 uv1;
layout(location = 11) flat out vec4 emission_opacity;

uint state;

// O'Neill, "PCG" (2014), section 6.3: RXS M XS with 32 bits of state.
uint random()
{
    state = state * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

float unit()
{
    return float(random() >> 8) / 16777216.0;
}

vec3 direction()
{
    float z = 2.0 * unit() - 1.0, longitude = 6.2831853 * unit();
    return vec3(sqrt(1.0 - z * z) * vec2(cos(longitude), sin(longitude)), z);
}

// Zero, below the smallest normal number, tiny, huge, almost infinite, infinite, no number, any bits at all.
float hostile_number()
{
    switch (random() % 8u) {
    case 0u: return 0.0;
    case 1u: return uintBitsToFloat(random() & 0x807fffffu);
    case 2u: return 1e-23 * unit();
    case 3u: return -1e20 * unit();
    case 4u: return 3e38 * unit();
    case 5u: return uintBitsToFloat(0x7f800000u | (random() & 0x80000000u));
    case 6u: return uintBitsToFloat(0x7fc00000u);
    default: return uintBitsToFloat(random());
    }
}

bool attacks()
{
    return random() % 256u < range.hostile;
}

// `sane`, or the same of another length, or with hostile parts.
vec3 perhaps(vec3 sane)
{
    if (!attacks())
        return sane;
    switch (random() % 4u) {
    case 0u: return vec3(hostile_number(), sane.yz);
    case 1u: return vec3(hostile_number(), hostile_number(), hostile_number());
    case 2u: return sane * hostile_number();
    default: return vec3(hostile_number());
    }
}

void main()
{
    Material material = materials[instances[range.instance].material];
    base_color_metallic = vec4(material.base_color, material.metallic);
    surface_factors = vec4(material.roughness, material.alpha_cutoff, material.dielectric.f0.r, 0.0);
    uint pixel = range.first + uint(gl_VertexIndex) / 3u, corner = uint(gl_VertexIndex) % 3u;
    // What the whole triangle shares: mostly one frame for all corners, sometimes others, which may cancel.
    state = pixel * 9781u + range.seed;
    random();
    vec3 n = direction(), t = direction(), p = direction() * pow(10.0, 6.0 * unit() - 4.0);
    if (range.inside == 1u && random() % 4u == 0u && frame.light_count > 0u)
        p = lights[random() % frame.light_count].position; // in a point light
    if (range.inside == 1u && random() % 16u == 0u)
        p = frame.eyes[0].world_from_view[3].xyz; // in the eye
    bool own = random() % 4u == 0u, turned = random() % 2u == 0u;
    // All corners of a triangle are attacked alike, or each for itself.
    state += random() % 2u == 0u ? 0u : corner * 0x9e3779b9u;
    covered_position = vec4(perhaps(p), 1.0);
    vertex_colour = vec4(1.0);
    uv1 = vec2(0.0);
    emission_opacity = vec4(0.0, 0.0, 0.0, 1.0);
    position_centre = covered_position.xyz;
    covered_lightmap_uv = vec2(0.0);
    normal_world = perhaps(own ? (corner == 0u ? n : -n) : n);
    tangent_world = vec4(perhaps(t), attacks() ? hostile_number() : random() % 2u == 0u ? 1.0 : -1.0);
    uv = 8.0 * vec2(unit(), unit()) - 4.0;
    if (attacks())
        uv = vec2(1e6, -1e6) * unit();
    eye = 0u;
    // A right-angled triangle around its pixel's centre, either way round.
    vec2 at = vec2(pixel % range.size.x, pixel / range.size.x) + 0.5;
    vec2 around = corner == 0u ? vec2(-0.3, -0.3) : (corner == 1u) == turned ? vec2(0.45, -0.3) : vec2(-0.3, 0.45);
    gl_Position = vec4(2.0 * (at + around) / vec2(range.size) - 1.0, 0.5, 1.0);
}
