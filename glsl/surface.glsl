// A fragment's material and shading frame, for every stage that shades one; its vertex outputs are forward.vert's.
#ifndef SURFACE_GLSL
#define SURFACE_GLSL

#include "draw.glsl"
#include "instance.glsl"
#include "math.glsl"
#include "brdf.glsl"
#include "shading_point.glsl"

// Stages that draw many places of each pixel read the texels themselves.
#ifndef SURFACE_TEXEL
#define SURFACE_TEXEL(map, at) texture(map, at)
#endif

// And those that follow light through bodies absorb it there, not at surfaces.
#ifndef FOLLOWS_BODIES
#define FOLLOWS_BODIES false
#endif

layout(BASE_COLOR_MAP) uniform sampler2D base_color_map;
layout(NORMAL_MAP) uniform sampler2D normal_map;
layout(ORM_MAP) uniform sampler2D orm_map; // occlusion, roughness, metallic, clear coat
layout(EMISSION_MAP) uniform sampler2D emission_map;
layout(EXTENSION_MAP) uniform sampler2D extension_map;

layout(location = 0) centroid in vec4 covered_position;
layout(location = 1) centroid in vec3 normal_world;
layout(location = 2) in vec2 uv;
layout(location = 3) centroid in vec4 tangent_world;
layout(location = 4) flat in uint eye;
layout(location = 5) flat in vec4 base_color_metallic;
layout(location = 6) flat in vec4 surface_factors;
layout(location = 8) centroid in vec2 covered_lightmap_uv;
layout(location = 7) in vec3 position_centre;
layout(location = 9) centroid in vec4 vertex_colour;
layout(location = 10) in vec2 uv1;
layout(location = 11) flat in vec4 emission_opacity;

// Where the fragment covers its triangle. Divided by an interpolated 1: lavapipe divides centroids by their pixel's w.
vec3 position_world = covered_position.xyz / covered_position.w;
vec2 lightmap_uv = covered_lightmap_uv / covered_position.w;

vec2 map_uv(uint map)
{
    return (SECOND_UV >> map & 1u) != 0u ? uv1 : uv;
}

// Tangent, bitangent and normal. MikkTSpace: the bitangent is made per fragment, and n and t enter as interpolated, not
// renormalised, because that is how maps were baked (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited",
// section 3.3).
mat3 tangent_space()
{
    return mat3(tangent_world.xyz, tangent_world.w * cross(normal_world, tangent_world.xyz), normal_world);
}

// The normal map's vector in world space.
vec3 mapped_normal()
{
    vec3 n = normalize_or(normal_world, vec3(0.0, 1.0, 0.0));
    if (!HAS_NORMAL_MAP)
        return n;
    // Two channels hold a unit vector on the surface's own side.
    vec2 m_xy = 2.0 * SURFACE_TEXEL(normal_map, map_uv(MAP_NORMAL)).xy - 1.0;
    vec3 m = vec3(m_xy, sqrt(max(1.0 - dot(m_xy, m_xy), 0.0)));
    return normalize_or(tangent_space() * m, n);
}

// The normal of the triangle itself, towards the eye: smooth normals are not where shadow maps have the surface. In a picture
// whose y runs down, a cross product of the two steps points away from the eye.
vec3 triangle_normal()
{
    vec3 n = normalize_or(normal_world, vec3(0.0, 1.0, 0.0));
    return normalize_or(cross(dFdy(position_centre), dFdx(position_centre)), gl_FrontFacing ? n : -n);
}

// Variance of a unit vector within the pixel, across which it is assumed to turn evenly: a box.
float pixel_variance(vec3 v)
{
    vec3 across = dFdx(v), down = dFdy(v);
    return (dot(across, across) + dot(down, down)) / 12.0;
}

// Discards the part of the pixel that is in a hole; `above`: alpha over the cutoff.
void cut_out(float above);

Surface read_surface()
{
    Surface s;
    vec4 factors = VERTEX_COLOURS != COLOURS_OF_NOTHING ? vertex_colour : vec4(1.0);
    if (HAS_BASE_COLOR_MAP)
        factors *= SURFACE_TEXEL(base_color_map, map_uv(MAP_BASE_COLOR));
    vec4 base = vec4(base_color_metallic.rgb, emission_opacity.w) * factors;
    if (ALPHA_MASK)
        cut_out(base.a - surface_factors.y);
    s.base_color = base.rgb;
    s.alpha = BLENDS ? base.a : 1.0;
    s.transmission = vec3(1.0);
    if (TINTS) {
        // Colours of maps and vertices are those of what goes through.
        Material material = materials[instances[draw.instance].material];
        bool follows = FOLLOWS_BODIES && material.ior > 1.0;
        s.transmission = factors.rgb * (follows ? material.surface_transmission : material.transmission);
        s.base_color = base_color_metallic.rgb;
    }
    s.emission = EMITS ? emission_opacity.rgb * SURFACE_TEXEL(emission_map, map_uv(MAP_EMISSION)).rgb : vec3(0.0);
    if (VERTEX_COLOURS == COLOURS_OF_EMISSION)
        s.emission *= vertex_colour.rgb;
    vec4 maps = HAS_ORM_MAP ? SURFACE_TEXEL(orm_map, map_uv(MAP_ORM)) : vec4(1.0);
    s.occlusion = maps.r;
    s.roughness = maps.g * surface_factors.x;
    s.metallic = METALNESS == METALNESS_MIXED ? maps.b * base_color_metallic.a : float(METALNESS == METALNESS_METAL);
    vec4 extension = vec4(1.0);
    if (EXTENSION_MAP_OF != EXTENSION_NONE && EXTENSION_MAP_OF < EXTENSION_BODY)
        extension = SURFACE_TEXEL(extension_map, map_uv(MAP_EXTENSION));
    s.dielectric = bare_fresnel(vec3(surface_factors.z), 1.0);
    if (SPECULAR) {
        Material material = materials[instances[draw.instance].material];
        s.dielectric = bare_fresnel(material.dielectric.f0, material.dielectric.f90);
        if (FILM)
            s.dielectric = with_film(material, maps.a);
        if (EXTENSION_MAP_OF == EXTENSION_SPECULAR)
            s.dielectric = dielectric_by_map(s.dielectric, extension);
    }
    vec3 n = mapped_normal(), own_n = normalize_or(normal_world, vec3(0.0, 1.0, 0.0));
    // Cloth and leaves are seen from behind, too.
    s.n = gl_FrontFacing ? n : -n;
    s.clearcoat_n = gl_FrontFacing ? own_n : -own_n;
    s.clearcoat = 0.0;
    s.clearcoat_roughness = 1.0;
    if (CLEARCOAT) {
        Material material = materials[instances[draw.instance].material];
        s.clearcoat = material.clearcoat * maps.a;
        s.clearcoat_roughness = max(material.clearcoat_roughness, MIN_CLEARCOAT_ROUGHNESS);
        if ((material.flags & MATERIAL_CLEARCOAT_BUMPS) != 0u)
            s.clearcoat_n = s.n;
    }
    s.sheen = vec3(0.0);
    s.sheen_roughness = 1.0;
    if (SHEEN) {
        Material material = materials[instances[draw.instance].material];
        s.sheen = material.sheen;
        s.sheen_roughness = material.sheen_roughness;
        if (EXTENSION_MAP_OF == EXTENSION_SHEEN) {
            s.sheen *= extension.rgb;
            s.sheen_roughness = max(s.sheen_roughness * extension.a, MIN_SHEEN_ROUGHNESS);
        }
    }
    s.diffuse_transmission = vec3(0.0);
    if (DIFFUSE_TRANSMISSION) {
        Material material = materials[instances[draw.instance].material];
        vec4 texel = EXTENSION_MAP_OF == EXTENSION_DIFFUSE_TRANSMISSION ? extension : vec4(1.0);
        s = diffusing_through(s, material.diffuse_transmission * texel.a, material.diffuse_transmission_color * texel.rgb);
    }
    s = unstretched(s);
    if (ANISOTROPY) {
        vec2 along = materials[instances[draw.instance].material].anisotropy;
        if (EXTENSION_MAP_OF == EXTENSION_ANISOTROPY)
            along = stretch_by_map(along, extension);
        s = stretched(s, tangent_space() * vec3(along, 0.0), length(along));
    }
    s.v = normalize_or(frame.eyes[eye].world_from_view[3].xyz - position_world, s.n);
    // A mapped normal may lean away from the eye; the surface is seen all the same.
    s.nv = clamp(dot(s.n, s.v), MIN_COS, 1.0);
    if (BLENDS && surface_factors.w > 0.0)
        s.alpha = slanted_coverage(s.alpha, s.nv);
    return s;
}

#endif
