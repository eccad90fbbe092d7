// The surfaces that rays meet: places, frames and materials of hits, in world space.
#ifndef RAY_SURFACE_GLSL
#define RAY_SURFACE_GLSL

#include "instance.glsl"
#include "brdf.glsl"
#include "bvh.glsl"
#include "math.glsl"
#include "octahedral.glsl"
#include "random.glsl"
#include "sampling.glsl"
#include "shading_point.glsl"

// As models stand in the scene, before `frame.world_from_models`.
struct RayCorner {
    uvec2 frame; // normal and tangent, packed
    vec2 uv;
    uint lightmap_uv; // two fractions of 65535
};

layout(RAY_CORNERS, scalar) readonly buffer RayCorners { RayCorner ray_corners[]; }; // three for each triangle
// Layer i: the textures with which the materials of texture set i are drawn, reduced.
layout(RAY_BASE_COLOR) uniform sampler2DArray ray_base_color;
layout(RAY_NORMAL) uniform sampler2DArray ray_normal;
layout(RAY_ORM) uniform sampler2DArray ray_orm;
layout(RAY_EMISSION) uniform sampler2DArray ray_emission;
layout(RAY_EXTENSION) uniform sampler2DArray ray_extension;
// As RAY_CORNERS, or a single one where no corner needs any.
layout(RAY_CORNER_EXTRAS, scalar) readonly buffer RayCornerExtras { VertexExtra ray_corner_extras[]; };

// A point that light scatters at.
struct PathPoint {
    Surface s;
    vec3 position;
    vec3 side;     // unit normal of the triangle, towards where the path came from
    float rounding; // metres that the position may be off by
};

// Part of a coordinate or a distance that rounding may move a position by: about 128 units in the last place, which
// interpolation by rasterisers needs.
const float ROUNDING = 1.5e-5;

float position_rounding(vec3 position, float distance_metres)
{
    vec3 size = abs(position);
    return ROUNDING * max(max(size.x, size.y), max(size.z, distance_metres));
}

vec2 ray_uv(RayHit hit)
{
    uint first = 3u * hit.triangle;
    return hit.weights.x * ray_corners[first].uv + hit.weights.y * ray_corners[first + 1u].uv
        + hit.weights.z * ray_corners[first + 2u].uv;
}

vec2 ray_uv1(RayHit hit)
{
    uint first = 3u * hit.triangle;
    return hit.weights.x * ray_corner_extras[first].uv1 + hit.weights.y * ray_corner_extras[first + 1u].uv1
        + hit.weights.z * ray_corner_extras[first + 2u].uv1;
}

vec4 ray_colour(RayHit hit)
{
    uint first = 3u * hit.triangle;
    return hit.weights.x * unpacked_colour(ray_corner_extras[first])
        + hit.weights.y * unpacked_colour(ray_corner_extras[first + 1u])
        + hit.weights.z * unpacked_colour(ray_corner_extras[first + 2u]);
}

// Whether some material has this map.
bool has_map(uint map)
{
    return rays_have(RAYS_MAPS << map);
}

// A coordinate beyond 0 to 1 as its map means it, for a sampler that repeats; `margin`: half a texel.
float wrapped(float u, uint wrap, float margin)
{
    if (wrap == 0u)
        return u;
    return clamp(wrap == WRAP_MIRROR ? 1.0 - abs(mod(u, 2.0) - 1.0) : u, margin, 1.0 - margin);
}

// Where a map has its texel for a hit, of texture coordinates `uv` and of a picture of `side` texels.
vec3 ray_map_at(RayHit hit, Material material, vec2 uv, uint map, int side)
{
    if (rays_have(RAYS_EXTRAS) && (material.flags & MATERIAL_SECOND_UV << map) != 0u)
        uv = ray_uv1(hit);
    uint wraps = material.flags >> (MATERIAL_WRAPS + 4u * map);
    float margin = 0.5 / float(side);
    return vec3(wrapped(uv.x, wraps & 3u, margin), wrapped(uv.y, wraps >> 2u & 3u, margin), material.textures);
}

// By which the base color map and colours of vertices multiply base color and alpha at a hit.
vec4 ray_base_factors(RayHit hit, Material material, vec2 uv)
{
    vec4 factors = vec4(1.0);
    if (has_map(MAP_BASE_COLOR))
        factors = textureLod(ray_base_color, ray_map_at(hit, material, uv, MAP_BASE_COLOR, textureSize(ray_base_color, 0).x), 0.0);
    return rays_have(RAYS_EXTRAS) && (material.flags & MATERIAL_VERTEX_COLOURS) != 0u ? factors * ray_colour(hit) : factors;
}

bool is_tinting(Material material)
{
    return rays_have(RAYS_TINTS) && (material.flags & MATERIAL_TRANSMITS) != 0u;
}

bool refracts(Material material)
{
    return rays_have(RAYS_REFRACTS) && material.ior > 1.0;
}

// Base color of a hit. Of a sheet, colours of maps and vertices are those of what goes through.
vec3 ray_base(RayHit hit, Material material, vec2 uv)
{
    return is_tinting(material) ? material.base_color : material.base_color * ray_base_factors(hit, material, uv).rgb;
}

vec2 ray_metallic_roughness(RayHit hit, Material material, vec2 uv)
{
    if (!has_map(MAP_ORM))
        return vec2(material.metallic, material.roughness);
    vec3 at = ray_map_at(hit, material, uv, MAP_ORM, textureSize(ray_base_color, 0).x);
    return vec2(material.metallic, material.roughness) * textureLod(ray_orm, at, 0.0).bg;
}

// Whether rays end at the surfaces of bodies, instead of going straight through.
bool stops_at_bodies = false;

bool is_hole(RayHit hit, float cosine, out vec3 through)
{
    Material material = materials[bvh_material(hit.triangle)];
    if (stops_at_bodies && refracts(material))
        return false;
    vec4 factors = ray_base_factors(hit, material, ray_uv(hit));
    float alpha = material.opacity * factors.a;
    through = is_tinting(material) ? material.transmission * factors.rgb : vec3(1.0);
    if ((material.flags & MATERIAL_BLENDS) == 0u)
        return alpha < material.alpha_cutoff;
    if ((material.flags & MATERIAL_TRANSMITS) != 0u)
        alpha = slanted_coverage(alpha, cosine);
    // As many rays are stopped as the surface covers of what is behind. No two rays meet it in the same place.
    uvec4 place = uvec4(floatBitsToUint(hit.weights.xy), floatBitsToUint(hit.t), hit.triangle);
    return unit_from_bits(pcg4d(place).x) >= alpha;
}

vec4 ray_frame(RayCorner corner)
{
    return vec4(unpackSnorm2x16(corner.frame.x), unpackSnorm2x16(corner.frame.y));
}

// The interpolated normal, without a map.
vec3 ray_own_normal(RayHit hit)
{
    uint first = 3u * hit.triangle;
    vec3 n = vec3(0.0);
    for (uint i = 0u; i < 3u; ++i)
        n += hit.weights[i] * frame_normal(ray_frame(ray_corners[first + i]));
    return normalize_or(n, vec3(0.0, 1.0, 0.0));
}

// Tangent, bitangent and normal as interpolated, neither perpendicular nor of unit length: see surface.glsl's `tangent_space`.
mat3 ray_tangent_space(RayHit hit)
{
    uint first = 3u * hit.triangle;
    vec3 n = vec3(0.0), t = vec3(0.0);
    for (uint i = 0u; i < 3u; ++i) {
        vec4 frame_local = ray_frame(ray_corners[first + i]);
        n += hit.weights[i] * frame_normal(frame_local);
        t += hit.weights[i] * frame_tangent(frame_local).xyz;
    }
    return mat3(t, frame_tangent(ray_frame(ray_corners[first])).w * cross(n, t), n);
}

// The normal map's vector.
vec3 ray_normal_of(RayHit hit, Material material, vec2 uv)
{
    if (!has_map(MAP_NORMAL))
        return ray_own_normal(hit);
    vec3 at = ray_map_at(hit, material, uv, MAP_NORMAL, textureSize(ray_normal, 0).x);
    vec2 m_xy = 2.0 * textureLod(ray_normal, at, 0.0).xy - 1.0;
    float m_z = sqrt(max(1.0 - dot(m_xy, m_xy), 0.0));
    return normalize_or(ray_tangent_space(hit) * vec3(m_xy, m_z), vec3(0.0, 1.0, 0.0));
}

vec2 corner_lightmap_uv(uint corner)
{
    uint packed_uv = ray_corners[corner].lightmap_uv;
    return vec2(packed_uv & 0xffffu, packed_uv >> 16u) / float(LIGHTMAP_STEPS);
}

// Where the lightmap has what a hit gives back; layer 1: backs.
vec3 lightmap_address(RayHit hit, bool back)
{
    uint first = 3u * hit.triangle;
    vec2 at = hit.weights.x * corner_lightmap_uv(first) + hit.weights.y * corner_lightmap_uv(first + 1u)
        + hit.weights.z * corner_lightmap_uv(first + 2u);
    return vec3(at, back ? 1.0 : 0.0);
}

// Radiance of a hit's own light.
vec3 ray_emission_of(RayHit hit, Material material, vec2 uv)
{
    if (!rays_have(RAYS_EMITTERS) || material.emission == vec3(0.0))
        return vec3(0.0);
    vec3 emission = material.emission;
    if (has_map(MAP_EMISSION))
        emission *= textureLod(ray_emission, ray_map_at(hit, material, uv, MAP_EMISSION, textureSize(ray_emission, 0).x), 0.0).rgb;
    return rays_have(RAYS_EXTRAS) && (material.flags & MATERIAL_UNLIT) != 0u ? emission * ray_colour(hit).rgb : emission;
}

vec3 emission_of_hit(RayHit hit)
{
    return ray_emission_of(hit, materials[bvh_material(hit.triangle)], ray_uv(hit));
}

// The extension map, if that is what it is of.
vec4 ray_extension_of(RayHit hit, Material material, vec2 uv, uint of)
{
    if (!has_map(MAP_EXTENSION) || material.extension != of)
        return vec4(1.0);
    return textureLod(ray_extension, ray_map_at(hit, material, uv, MAP_EXTENSION, textureSize(ray_extension, 0).x), 0.0);
}

// What the ORM map says of the layer above: its share, or thickness.
float ray_layer(RayHit hit, Material material, vec2 uv)
{
    if (!has_map(MAP_ORM))
        return 1.0;
    return textureLod(ray_orm, ray_map_at(hit, material, uv, MAP_ORM, textureSize(ray_orm, 0).x), 0.0).a;
}

// The coat of a hit; `own_from_local`: turns normals to the world and to the ray's side.
void set_clearcoat(inout Surface s, RayHit hit, Material material, vec2 uv, mat3 own_from_local)
{
    s.clearcoat = material.clearcoat;
    if (s.clearcoat > 0.0)
        s.clearcoat *= ray_layer(hit, material, uv);
    s.clearcoat_roughness = max(material.clearcoat_roughness, MIN_CLEARCOAT_ROUGHNESS);
    s.clearcoat_n = s.n;
    if (has_map(MAP_NORMAL) && (material.flags & MATERIAL_CLEARCOAT_BUMPS) == 0u)
        s.clearcoat_n = own_from_local * ray_own_normal(hit);
}

// The surface of a hit with its highlights stretched where the material says so; `world_from_models` turns directions.
Surface stretched_hit(Surface s, RayHit hit, Material material, vec2 uv, mat3 world_from_models)
{
    vec2 along = material.anisotropy;
    if (along == vec2(0.0))
        return unstretched(s);
    if (has_map(MAP_EXTENSION) && material.extension == EXTENSION_ANISOTROPY)
        along = stretch_by_map(along, ray_extension_of(hit, material, uv, EXTENSION_ANISOTROPY));
    return stretched(s, world_from_models * (ray_tangent_space(hit) * vec3(along, 0.0)), length(along));
}

// What a ray of unit direction d met.
PathPoint ray_point(RayHit hit, vec3 d)
{
    BvhTriangle triangle = bvh_triangle(hit.triangle);
    Material material = materials[triangle.material_and_flags & BVH_MATERIAL];
    vec2 uv = ray_uv(hit);
    mat3 turn = mat3(frame.world_from_models);
    vec3 place = hit.weights.x * triangle.a + hit.weights.y * triangle.b + hit.weights.z * triangle.c;
    vec3 g = turn * normalize_or(bvh_normal(hit.triangle), vec3(0.0, 1.0, 0.0));
    float front = dot(g, d) <= 0.0 ? 1.0 : -1.0;
    vec2 metallic_roughness = ray_metallic_roughness(hit, material, uv);
    PathPoint p;
    p.position = (frame.world_from_models * vec4(place, 1.0)).xyz;
    p.side = front * g;
    p.rounding = position_rounding(p.position, hit.t);
    p.s.n = front * (turn * ray_normal_of(hit, material, uv));
    p.s.v = -d;
    p.s.nv = clamp(dot(p.s.n, p.s.v), MIN_COS, 1.0);
    p.s.base_color = ray_base(hit, material, uv);
    p.s.alpha = 1.0; // rays pass through what is not covered
    p.s.transmission = vec3(1.0);
    if (refracts(material))
        p.s.transmission = material.surface_transmission * ray_base_factors(hit, material, uv).rgb;
    p.s.emission = ray_emission_of(hit, material, uv);
    p.s.metallic = metallic_roughness.x;
    p.s.roughness = metallic_roughness.y;
    p.s.dielectric = bare_fresnel(material.dielectric.f0, material.dielectric.f90);
    if (rays_have(RAYS_FILM) && material.dielectric.film.share > 0.0)
        p.s.dielectric = with_film(material, ray_layer(hit, material, uv));
    if (has_map(MAP_EXTENSION))
        p.s.dielectric = dielectric_by_map(p.s.dielectric, ray_extension_of(hit, material, uv, EXTENSION_SPECULAR));
    p.s.clearcoat = 0.0;
    if (rays_have(RAYS_CLEARCOAT))
        set_clearcoat(p.s, hit, material, uv, front * turn);
    p.s.sheen = rays_have(RAYS_SHEEN) ? material.sheen : vec3(0.0);
    p.s.sheen_roughness = material.sheen_roughness;
    if (rays_have(RAYS_SHEEN) && has_map(MAP_EXTENSION)) {
        vec4 texel = ray_extension_of(hit, material, uv, EXTENSION_SHEEN);
        p.s.sheen *= texel.rgb;
        p.s.sheen_roughness = max(p.s.sheen_roughness * texel.a, MIN_SHEEN_ROUGHNESS);
    }
    p.s.diffuse_transmission = vec3(0.0);
    if (rays_have(RAYS_DIFFUSE_TRANSMISSION) && material.diffuse_transmission > 0.0) {
        vec4 texel = ray_extension_of(hit, material, uv, EXTENSION_DIFFUSE_TRANSMISSION);
        vec3 color = material.diffuse_transmission_color * texel.rgb;
        p.s = diffusing_through(p.s, material.diffuse_transmission * texel.a, color);
    }
    p.s = rays_have(RAYS_ANISOTROPY) ? stretched_hit(p.s, hit, material, uv, turn) : unstretched(p.s);
    p.s.occlusion = 1.0; // rays find out themselves what light reaches
    return p;
}

// Whether a ray of direction d met the back of a triangle.
bool is_back(RayHit hit, vec3 d)
{
    return dot(bvh_normal(hit.triangle), d * mat3(frame.world_from_models)) > 0.0;
}

// Cosine of a ray of unit direction d to the normal of the triangle that it met.
float hit_cosine(RayHit hit, vec3 d)
{
    return bvh_cosine(hit, d * mat3(frame.world_from_models));
}

// The first hit of a ray in world space, with t in metres.
RayHit trace_ray(vec3 o, vec3 d, float far, bool any)
{
    mat3 turn = mat3(frame.world_from_models);
    return bvh_trace((o - frame.world_from_models[3].xyz) * turn, d * turn, far, any);
}

// What a ray lets arrive of light from `far` metres away: nothing where something blocks it, and less of some colours behind
// sheets that change them.
vec3 ray_transmission(vec3 o, vec3 d, float far)
{
    RayHit hit = trace_ray(o, d, far, true);
    return hit.t >= 0.0 ? vec3(0.0) : hit.transmission;
}

// Where rays begin: clear of the triangle they leave, on the side that they are seen from.
vec3 ray_origin(PathPoint p)
{
    return p.position + 2.0 * p.rounding * p.side;
}

#endif
