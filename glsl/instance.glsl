// Instances and materials, one after the other in buffers.
#ifndef INSTANCE_GLSL
#define INSTANCE_GLSL

#include "shared.glsl"
#include "brdf.glsl"

struct Instance {
    mat4 world_from_local; // rotation, uniform scale, translation
    uint material;
};

struct Material {
    vec3 base_color;
    float metallic;
    float roughness;
    float alpha_cutoff;
    uint textures; // the set they are drawn with
    float opacity;
    vec3 emission; // radiance, W/(m^2 sr)
    uint flags;
    Fresnel dielectric; // of the part that is no metal
    float film_thinnest; // where the map of its thickness is 0
    vec3 transmission; // by which light is multiplied that goes through
    float clearcoat;
    float clearcoat_roughness;
    vec3 surface_transmission; // by which light that goes through the surface of a body is multiplied, without
    vec3 absorption;           // what the body absorbs, 1/m
    float ior; // above 1 if it is the surface of bodies that bend light
    float ior_spread; // by how much that of blue is above it, and that of red below it
    vec3 body_centre;  // what the map of a convex body is about, local space:
    float body_radius; // see asset::material::BodyShape
    vec3 sheen;
    float sheen_roughness;
    vec2 anisotropy; // direction in which highlights are stretched, along tangent and bitangent, as long as they are strongly
    float diffuse_transmission; // the share of diffuse light that goes through to the other side,
    vec3 diffuse_transmission_color; // and its color
    uint extension; // what the extension map is of
};

// A dielectric as its extension map has it: see asset::material::Extension.
Fresnel dielectric_by_map(Fresnel f, vec4 texel)
{
    f.f0 *= texel.rgb * texel.a;
    f.f90 *= texel.a;
    f.film.base_f0 *= texel.rgb * texel.a;
    return f;
}

// A stretch of highlights as its extension map has it: turned and shortened.
vec2 stretch_by_map(vec2 along, vec4 texel)
{
    vec2 map = 2.0 * texel.xy - 1.0;
    return vec2(along.x * map.x - along.y * map.y, along.x * map.y + along.y * map.x);
}

// A dielectric with its film; `thickness`: what the map of it says.
Fresnel with_film(Material material, float thickness)
{
    Fresnel f = material.dielectric;
    f.film.thickness = mix(material.film_thinnest, f.film.thickness, thickness);
    return f;
}

// Least roughness of a clear coat: its lobe is narrower than a texel of any panorama, and never taken for a mirror's.
const float MIN_CLEARCOAT_ROUGHNESS = 0.011;

// What few vertices have, parallel to them.
struct VertexExtra {
    vec2 uv1;     // second texture coordinates
    uvec2 colour; // four fractions of 65535
};

// `flags`: colours of vertices count; alpha is coverage; from the third bit on for each map: it is looked up by the second texture
// coordinates; colours of vertices count for emission; more is covered at slanted views, as by a sheet of glass. Maps are base
// color, normal, ORM, emission and extension.
const uint MATERIAL_VERTEX_COLOURS = 1;
const uint MATERIAL_BLENDS = 2;
const uint MATERIAL_SECOND_UV = 4;
const uint MATERIAL_UNLIT = 128;
const uint MATERIAL_TRANSMITS = 1u << 28;
const uint MATERIAL_CLEARCOAT_BUMPS = 1u << 29; // the normal map shows in the clear coat
// From this bit on for each map how coordinates beyond 0 to 1 are meant, two bits for u and two for v: the order of
// asset::material::Wrap.
const uint MATERIAL_WRAPS = 8;
const uint WRAP_MIRROR = 1;
const uint WRAP_CLAMP = 2;

const uint MAP_BASE_COLOR = 0;
const uint MAP_NORMAL = 1;
const uint MAP_ORM = 2;
const uint MAP_EMISSION = 3;
const uint MAP_EXTENSION = 4;

vec4 unpacked_colour(VertexExtra extra)
{
    return vec4(unpackUnorm2x16(extra.colour.x), unpackUnorm2x16(extra.colour.y));
}

layout(SCENE_INSTANCES, scalar) readonly buffer Instances { Instance instances[]; };
layout(SCENE_MATERIALS, scalar) readonly buffer Materials { Material materials[]; };
// One for each vertex, or a single one where no vertex needs any.
layout(SCENE_VERTEX_EXTRAS, scalar) readonly buffer VertexExtras { VertexExtra vertex_extras[]; };

#endif
