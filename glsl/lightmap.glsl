// A lightmap while it is computed: its texels, what they give back, and places on the surfaces they stand for.
#ifndef LIGHTMAP_GLSL
#define LIGHTMAP_GLSL

#include "shared.glsl"
#include "emitters.glsl"
#include "given_back.glsl"
#include "importance.glsl"
#include "lamp.glsl"

layout(local_size_x = 64) in;

const uint NO_TEXEL = 0xffffffffu;

struct LightmapTexel {
    uint place;    // column and row
    uint triangle; // the upper bit: its back
};

const uint LIGHTMAP_BACK = 0x80000000u;

const uint RELAY_GLOSSY = 0x80000000u;

// A place that light from a lamp or from something that shines met.
struct Relay {
    vec3 position;
    vec3 side;       // unit normal, towards that
    vec3 radiance;   // that it gives back of lamps and sun, W/(m^2 sr)
    float density;   // of such places per area
    uint triangle;   // the upper bit: it is not matt
    vec3 weights;
    vec3 address;    // in the lightmap
};

// What a texel is like, and what is around it.
struct LightmapSurface {
    vec4 albedo;    // with the share of places that are glossy
    vec3 through;   // the same for light on the other side, which diffuses through
    uint places;    // bit i: its place i is one that can be seen
    vec3 place;     // mean of its places that are seen, metres
    vec3 normal;    // mean of their normals
    float extent;   // metres along a texel
    // Once bounces are kept:
    vec4 unblocked; // sum over rays that nothing blocks of the models' direction, and their number
    float rays;     // all of them
    vec3 surfaces;  // sum of the irradiance of surfaces that block the others
};

// What a texel's samples add up to.
struct LightmapSums {
    vec4 all;     // irradiance of this bounce, and its samples
    float uneven; // brightness of one half of these samples, less that of the other half
    // The same by how much is given back of what comes from each direction:
    vec4 steady;  // what no bounce changes over the samples of all of them, and their number
    vec3 bounced; // the rest, of this bounce
    vec2 sky;     // squares of the open sky's luminance over the bounces' samples: of those that met nothing, and of all
    // Irradiance over bounces that is shown until the last one is there, and its samples. After the bounces `sky` with that of
    // the texels around. At last what the filter goes by: mean irradiance, and the variance of a texel's brightness.
    vec4 kept;
    // What the filter gives: mean irradiance, and the variance of what is left of the noise of its brightness.
    vec4 filtered;
};

layout(LIGHTMAP_TEXELS, scalar) readonly buffer LightmapTexels { LightmapTexel lightmap_texels[]; };
layout(LIGHTMAP_SUMS, scalar) buffer SumsOfTexels { LightmapSums lightmap_sums[]; };
layout(LIGHTMAP_SURFACES, scalar) buffer LightmapSurfaces { LightmapSurface lightmap_surfaces[]; };
// For each texel of each layer, its index in the list of those above, or all bits.
layout(LIGHTMAP_INDICES, scalar) readonly buffer LightmapIndices { uint lightmap_indices[]; };
layout(LIGHTMAP_RELAYS, scalar) buffer LightmapRelays { Relay relays[]; };
// Layer 0: fronts, layer 1: backs. Given back of direct light, from lamps, sun and has_direct_shining, with the density of
// relays; of soft light, with the share that is glossy; and soft light itself as irradiance, with 1 where it is known, in
// as many layers more its openness, and in as many again the radiance of what blocks.
layout(LIGHTMAP_DIRECT) uniform sampler2DArray given_back_of_direct;
layout(LIGHTMAP_SOFT) uniform sampler2DArray given_back_of_soft;
layout(LIGHTMAP_DIRECT_IMAGE, rgba16f) uniform image2DArray direct_image;
layout(LIGHTMAP_SOFT_IMAGE, rgba16f) uniform image2DArray soft_image;
layout(LIGHTMAP_LIGHT_IMAGE, rgba16f) uniform image2DArray light_image;

layout(push_constant, scalar) uniform Work {
    uint first;        // texel or relay
    uint count;        // of them
    uint sequence;     // of random numbers; those of different ones are independent
    uint first_sample; // its number in the sequence
    uint samples;
    uint flags;
    uint relay_count;  // 0: none are used
    float spot_density; // of relays per area from which a place is near what shines
    uint probe_count;
    uint half_of_samples; // of those of a texel in all, a power of two
} work;

// `flags`: sums begin with these samples; what is known is shown from now on; their sky is counted; their sums are kept.
const uint WORK_BEGINS = 1;
const uint WORK_IS_SHOWN = 2;
const uint WORK_COUNTS = 4;
const uint WORK_KEEPS = 8;

// How far places are kept from edges, in roundings of a position.
const float OFF_EDGE = 16.0;

// Where the lightmap has one of LIGHTMAP_KINDS of a texel.
ivec3 kind_address(uint kind, ivec3 at)
{
    return at + ivec3(0, 0, int(kind) * imageSize(light_image).z / int(LIGHTMAP_KINDS));
}

// What noise is measured in: all channels alike, for blue specks are noise, too.
float brightness(vec3 irradiance)
{
    return dot(irradiance, vec3(1.0 / 3.0));
}

// The mean over rays of directions that nothing blocks.
vec4 openness_texel(LightmapSurface s)
{
    return vec4(s.unblocked.xyz / max(s.rays, 1.0), 1.0);
}

// Mean radiance of what the other rays met; where these are few, no more than a multiple of the mean of all.
const float MOST_BLOCKERS = 4.0;

vec4 blockers_texel(LightmapSurface s, vec3 irradiance)
{
    float blocked = max(s.rays - s.unblocked.w, 0.02 * s.rays);
    vec3 radiance = min(s.surfaces / max(blocked, TINY), MOST_BLOCKERS * irradiance) * INV_PI;
    return vec4(min(radiance, HALF_MOST), 1.0);
}

// Of sums of irradiance and their number. Noise of control variates may put it below zero: bounces that are cut off there
// give back too much.
vec3 mean_irradiance(vec4 sum)
{
    return sum.a > 0.0 ? clamp(sum.rgb / sum.a, -HALF_MOST, HALF_MOST) : vec3(0.0);
}

// What the lightmap shows of a texel beside its irradiance.
void store_directions(ivec3 at, LightmapSurface s, vec3 irradiance)
{
    imageStore(light_image, kind_address(LIGHTMAP_OPENNESS, at), openness_texel(s));
    imageStore(light_image, kind_address(LIGHTMAP_BLOCKERS, at), blockers_texel(s, irradiance));
}

// Irradiance of which a texel gives back its albedo.
vec3 irradiance_to_give(LightmapSums sums)
{
    return mean_irradiance(sums.steady) + mean_irradiance(vec4(sums.bounced, sums.all.a));
}

// The same on the other side of a texel's surface; 0 where nothing is known of that.
vec3 irradiance_behind(ivec3 at)
{
    int other = 1 - at.z;
    ivec3 size = imageSize(light_image);
    if (size.z < 2 * int(LIGHTMAP_KINDS))
        return vec3(0.0);
    uint index = lightmap_indices[(other * size.y + at.y) * size.x + at.x];
    return index == NO_TEXEL ? vec3(0.0) : max(irradiance_to_give(lightmap_sums[index]), 0.0);
}

// What a texel gives back of that.
void store_soft(ivec3 at, LightmapSurface s, vec3 irradiance)
{
    vec3 given = s.albedo.rgb * irradiance;
    if (rays_have(RAYS_DIFFUSE_TRANSMISSION) && s.through != vec3(0.0))
        given += s.through * irradiance_behind(at);
    imageStore(soft_image, at, vec4(given * INV_PI, s.albedo.a));
}

// The part of all relays that begin at what shines; the others begin at lamps.
float relays_of_emitters()
{
    return !has_emitters() ? 0.0 : lamp_count() == 0u ? 1.0 : 0.5;
}

// Whether what a texel gives back of light straight from what shines is part of its direct light, of the soft one else; `glossy`:
// share of its places.
bool has_direct_shining(float glossy)
{
    return rays_have(RAYS_RELAYS) && has_emitters() && glossy <= 0.5;
}

ivec3 texel_address(LightmapTexel texel)
{
    return ivec3(texel.place & 0xffffu, texel.place >> 16u, texel.triangle >> 31u);
}

float cross2(vec2 a, vec2 b)
{
    return a.x * b.y - a.y * b.x;
}

// Metres along a texel, as its triangle is stretched.
float texel_extent(LightmapTexel texel)
{
    uint index = texel.triangle & ~LIGHTMAP_BACK, first = 3u * index;
    vec2 a = corner_lightmap_uv(first), size = vec2(imageSize(light_image).xy);
    float texels = abs(cross2((corner_lightmap_uv(first + 1u) - a) * size, (corner_lightmap_uv(first + 2u) - a) * size));
    return sqrt(length(bvh_normal(index)) / max(texels, TINY));
}

// A place of a texel, as a hit of its triangle: where `part` of it lies, in [0, 1)^2, or the nearest place on the triangle.
RayHit texel_hit(LightmapTexel texel, vec2 part)
{
    uint triangle = texel.triangle & ~LIGHTMAP_BACK, first = 3u * triangle;
    vec2 a = corner_lightmap_uv(first), ab = corner_lightmap_uv(first + 1u) - a, ac = corner_lightmap_uv(first + 2u) - a;
    vec2 p = (vec2(texel.place & 0xffffu, texel.place >> 16u) + part) / vec2(imageSize(light_image).xy) - a;
    float area = cross2(ab, ac);
    vec3 weights = area != 0.0 ? vec3(0.0, cross2(p, ac) / area, cross2(ab, p) / area) : vec3(0.0);
    weights.x = 1.0 - weights.y - weights.z;
    weights = max(weights, vec3(0.0));
    return RayHit(0.0, triangle, weights / (weights.x + weights.y + weights.z), vec3(1.0));
}

// The point of a hit as a texel of that side sees it.
PathPoint texel_point(RayHit hit, bool back)
{
    BvhTriangle triangle = bvh_triangle(hit.triangle);
    vec3 g = normalize_or(mat3(frame.world_from_models) * bvh_normal(hit.triangle), vec3(0.0, 1.0, 0.0));
    PathPoint p = ray_point(hit, back ? g : -g);
    // Off the triangle's edge: from a place on the very line where a wall meets the floor, rays would pass the floor.
    vec3 middle = (triangle.a + triangle.b + triangle.c) * (1.0 / 3.0);
    vec3 inwards = (frame.world_from_models * vec4(middle, 1.0)).xyz - p.position;
    p.position += inwards * min(OFF_EDGE * p.rounding / max(length(inwards), TINY), 1.0);
    return p;
}

// Whether a ray meets what is never seen: the inside of a closed surface, or the back of one whose back no one sees. What
// lies at such a ray's beginning is not seen either, such as the foot of a wall that reaches below the floor.
bool is_never_seen(RayHit hit, vec3 d)
{
    return is_one_sided(hit.triangle) && is_back(hit, d);
}

// Whether a metal is so smooth that it does not give lamps' light back as if it were matt.
bool is_glossy(Surface s)
{
    return s.metallic > 0.5 && s.roughness < 0.6;
}

// Roughness of glossy surfaces as texels see them, at least: few rays meet what a sharper lobe shows of a lamp, and single texels
// would sparkle. Widening lobes keeps the light's mean: Kaplanyan and Dachsbacher, "Path Space Regularization for Holistic and
// Robust Light Transport" (2013).
const float CAUSTIC_ROUGHNESS = 0.5;

// What a place that is met along d gives back of lamps and the sun, by its BRDF; `density`: of relays there. Both at the very place:
// near a lamp they vary within a texel.
vec3 glossy_radiance(RayHit hit, vec3 d, out float density)
{
    PathPoint p = ray_point(hit, d);
    p.s.roughness = max(p.s.roughness, CAUSTIC_ROUGHNESS);
    p.s = unstretched(p.s);
    Energy energy = Energy(table_mean(brdf_table, p.s.roughness), MULTI_SCATTER, p.s.dielectric);
    vec2 at_v = table_entry(brdf_table, p.s.nv, p.s.roughness);
    vec3 sum = vec3(0.0);
    density = 0.0;
    for (uint i = 0u; i <= lamp_count(); ++i) {
        bool is_lamp = i < lamp_count();
        vec3 l = frame.sun.towards, irradiance = frame.sun.irradiance;
        float far = 1e30;
        if (is_lamp) {
            irradiance = light_irradiance(lights[i], p.position, l);
            far = distance(lights[i].position, p.position);
        }
        bool faces = dot(p.side, l) > 0.0 && irradiance != vec3(0.0);
        vec3 transmission = faces ? ray_transmission(ray_origin(p), l, far) : vec3(0.0);
        if (transmission == vec3(0.0))
            continue;
        if (is_lamp)
            density += lamp_density(dot(p.side, l), far) / float(lamp_count());
        sum += transmission * irradiance * max(dot(p.s.n, l), 0.0) * brdf(p.s, l, energy, at_v);
    }
    return sum;
}

// Place i of a texel.
vec2 texel_place(uint texel, uint i)
{
    return sobol(i, pcg4d(uvec4(texel, 0u, 0u, 0u)).xy);
}

#endif
