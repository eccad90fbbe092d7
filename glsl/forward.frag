// Shades one fragment: physically based, Phong, or one of the inputs and terms on its own.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "brdf.glsl"
#include "environment.glsl"
#include "output.glsl"

layout(set = 1, binding = 0, scalar) uniform Material {
    vec3 albedo;
    float metallic;
    float roughness;
    float alpha_cutoff;
} material;
layout(set = 1, binding = 1) uniform sampler2D albedo_map;
layout(set = 1, binding = 2) uniform sampler2D normal_map;
layout(set = 1, binding = 3) uniform sampler2D surface_map; // occlusion, roughness, metallic

layout(location = 0) centroid in vec3 position_world;
layout(location = 1) centroid in vec3 normal_world;
layout(location = 2) in vec2 uv;
layout(location = 3) centroid in vec4 tangent_world;
layout(location = 4) flat in uint eye;

layout(location = 0) out vec4 colour;

struct Surface {
    vec3 n; // shading normal, towards the eye's side
    vec3 v; // to the eye
    float nv;
    vec3 albedo;
    float metallic;
    float roughness;
    float occlusion;
};

// The normal map's vector in world space. MikkTSpace: the bitangent is made per fragment, and n and t enter as
// interpolated, not renormalised, because that is how the map was baked (Mikkelsen 2008, "Simulation of Wrinkled
// Surfaces Revisited", section 3.3).
vec3 mapped_normal()
{
    vec3 n = normalize_or(normal_world, vec3(0.0, 1.0, 0.0));
    if (!HAS_NORMAL_MAP)
        return n;
    // Two channels hold a unit vector on the surface's own side.
    vec2 m_xy = 2.0 * texture(normal_map, uv).xy - 1.0;
    vec3 m = vec3(m_xy, sqrt(max(1.0 - dot(m_xy, m_xy), 0.0)));
    vec3 b = tangent_world.w * cross(normal_world, tangent_world.xyz);
    return normalize_or(m.x * tangent_world.xyz + m.y * b + m.z * normal_world, n);
}

Surface read_surface()
{
    Surface s;
    s.albedo = material.albedo;
    if (HAS_ALBEDO_MAP) {
        vec4 texel = texture(albedo_map, uv);
        if (ALPHA_MASK && texel.a < material.alpha_cutoff)
            discard;
        s.albedo *= texel.rgb;
    }
    vec3 maps = HAS_SURFACE_MAP ? texture(surface_map, uv).rgb : vec3(1.0);
    s.occlusion = maps.r;
    s.roughness = maps.g * material.roughness;
    s.metallic = METALS == METALS_SOME ? maps.b * material.metallic : float(METALS == METALS_ALL);
    vec3 n = mapped_normal();
    // Cloth and leaves are seen from behind, too.
    s.n = gl_FrontFacing ? n : -n;
    s.v = normalize_or(frame.eyes[eye].world_from_view[3].xyz - position_world, s.n);
    // A mapped normal may lean away from the eye; the surface is seen all the same.
    s.nv = clamp(dot(s.n, s.v), MIN_COS, 1.0);
    return s;
}

// Irradiance of a point light on a surface that faces it, W/m^2, and its direction.
vec3 light_irradiance(PointLight light, out vec3 l)
{
    vec3 to_light = light.position - position_world;
    l = normalize_or(to_light, normal_world);
    return light.intensity / max(dot(to_light, to_light), 1e-8);
}

vec3 point_lights(Surface s)
{
    vec3 sum = vec3(0.0);
    uint count = LIGHTS < 0 ? frame.light_count : uint(LIGHTS);
    for (uint i = 0u; i < count; ++i) {
        vec3 l;
        vec3 irradiance = light_irradiance(lights[i], l);
        float nl = dot(s.n, l);
        if (nl <= 0.0)
            continue;
        if (SHADING == SHADING_PHONG) {
            vec3 f0 = f0_from_metallic(s.albedo, s.metallic);
            sum += irradiance * nl * (diffuse_lambert(s.albedo) + f0 * phong_specular(s.n, s.v, l, s.roughness));
        } else {
            sum += irradiance * nl * brdf(s.n, s.v, l, s.albedo, s.metallic, s.roughness, GEOMETRY);
        }
    }
    return sum;
}

// Phong knows neither metals nor mirror images of the surroundings: an ambient term and the lamps are all it has.
vec3 phong(Surface s)
{
    return s.albedo * environment_diffuse(s.n) * s.occlusion + point_lights(s);
}

struct Split {
    vec3 diffuse;
    vec3 specular;
};

// What the environment gives: the split sum. The diffuse part is what the specular part leaves, 1 - (F0 A + B).
Split environment(Surface s)
{
    SpecularLobe lobe = specular_lobe(s.n, s.v, s.nv, f0_from_metallic(s.albedo, s.metallic), s.roughness);
    Split split;
    split.diffuse = vec3(0.0);
    if (METALS != METALS_ALL) {
        vec3 left = (1.0 - lobe.reflectance) * (1.0 - s.metallic);
        split.diffuse = left * s.albedo * environment_diffuse(s.n) * s.occlusion;
    }
    split.specular = lobe.reflectance * environment_specular(lobe) * s.occlusion;
    return split;
}

vec3 physically_based(Surface s)
{
    Split split = environment(s);
    return split.diffuse + split.specular + point_lights(s);
}

// D, F and G for the first light, or for a lamp at the eye where the scene has none.
vec3 term(Surface s)
{
    vec3 l = s.v;
    if (frame.light_count > 0u)
        light_irradiance(lights[0], l);
    float nl = max(dot(s.n, l), 0.0);
    vec3 h = s.v + l;
    if (SHADING == SHADING_F)
        return f_schlick(f0_from_metallic(s.albedo, s.metallic), 0.5 * length(h));
    if (SHADING == SHADING_G)
        return vec3(v_direct(nl, s.nv, s.roughness, GEOMETRY) * 4.0 * nl * s.nv);
    // D has no upper bound: D / (1 + D) shows all of it.
    float d = d_ggx(s.n, h, alpha_from_roughness(s.roughness));
    return vec3(d / (1.0 + d));
}

// Radiance where the mode shows light.
vec3 light_of(Surface s)
{
    if (SHADING == SHADING_PHONG)
        return phong(s);
    if (SHADING == SHADING_DIFFUSE)
        return environment(s).diffuse;
    if (SHADING == SHADING_SPECULAR)
        return environment(s).specular;
    if (SHADING == SHADING_IRRADIANCE)
        return environment_diffuse(s.n);
    return physically_based(s);
}

// A number in [0, 1] where the mode shows one.
vec3 value_of(Surface s)
{
    if (SHADING == SHADING_NORMAL)
        return 0.5 * s.n + 0.5;
    if (SHADING == SHADING_METALLIC)
        return vec3(s.metallic);
    if (SHADING == SHADING_ROUGHNESS)
        return vec3(s.roughness);
    if (SHADING == SHADING_OCCLUSION)
        return vec3(s.occlusion);
    if (SHADING == SHADING_UV)
        return vec3(fract(uv), 0.0);
    if (SHADING == SHADING_TANGENT)
        return 0.5 * normalize_or(tangent_world.xyz, s.n) + 0.5;
    return term(s);
}

void main()
{
    Surface s = read_surface();
    bool shows_light = SHADING <= SHADING_PHONG || SHADING >= SHADING_DIFFUSE;
    if (SHADING == SHADING_ALBEDO)
        colour = display_colour(s.albedo);
    else if (shows_light)
        colour = display_radiance(light_of(s));
    else
        colour = display_value(value_of(s));
}
