// Shades one fragment: physically based, Phong, or one of the inputs and terms on its own. Stages say how holes are cut.
#ifndef FORWARD_GLSL
#define FORWARD_GLSL

#include "shared.glsl"
#include "brdf.glsl"
#include "clearcoat.glsl"
#include "energy.glsl"
#include "environment.glsl"
#include "openness.glsl"
#include "output.glsl"
#include "sheen.glsl"
#define FOLLOWS_BODIES REFRACTS
#include "surface.glsl"
#include "point_lights.glsl"
#include "sun_light.glsl"
#ifdef LOCAL_PROBES
#include "probes.glsl"
#include "sphere_lights.glsl"
#endif
#include "glass_body.glsl"

#ifdef TWO_SOURCES
layout(location = 0, index = 0) out vec4 colour;
layout(location = 0, index = 1) out vec4 behind; // by which what is behind is multiplied
#else
layout(location = 0) out vec4 colour;
#endif

// Phong has neither metals nor mirror images of the surroundings, only an ambient term, the sun and the point lights.
vec3 phong(Surface s)
{
    return s.base_color * environment_even(s.n).over_pi * s.occlusion + sun_light_phong(s) + point_lights_phong(s, position_world);
}

// The lightmap at one side of this fragment's triangle; of one of LIGHTMAP_KINDS.
vec3 lightmap_texel_of(uint kind, bool front)
{
    uint layer = kind * LIGHTMAP + (LIGHTMAP == LIGHTMAP_BOTH && !front ? 1u : 0u);
    return textureLod(lightmap, vec3(lightmap_uv, layer), 0.0).rgb;
}

// The same at the side that is seen.
vec3 lightmap_texel(uint kind)
{
    return lightmap_texel_of(kind, gl_FrontFacing);
}

// Soft light, of the lightmap or else of the panorama. A lightmap's irradiance is as the diffuse part takes it.
EvenLight even_light(Surface s)
{
    if (LIGHTMAP != LIGHTMAP_NONE)
        return EvenLight(lightmap_texel(LIGHTMAP_IRRADIANCE) * INV_PI, 1.0);
    EvenLight light = environment_even(s.n);
    light.over_pi *= s.occlusion;
    return light;
}

// Soft light on the other side as irradiance over pi.
vec3 soft_light_behind(Surface s)
{
    if (LIGHTMAP == LIGHTMAP_NONE)
        return environment_even(-s.n).over_pi * s.occlusion;
    return LIGHTMAP == LIGHTMAP_BOTH ? lightmap_texel_of(LIGHTMAP_IRRADIANCE, !gl_FrontFacing) * INV_PI : vec3(0.0);
}

struct Split {
    vec3 diffuse;
    vec3 specular;
};

// Of the normals.
float normal_variance()
{
    return pixel_variance(normalize_or(normal_world, vec3(0.0, 1.0, 0.0)));
}

SpecularLobe lobe_of(Surface s)
{
    return specular_lobe(s.n, s.v, s.nv, seen_fresnel(fresnel_of(s), s.nv), s.roughness, normal_variance());
}

// The share of a lobe's light that comes from as far away as its image shows it: see share_in_image in lightmap_gather.comp. What is
// linear in the direction has its mean over the lobe at the lobe's mean vector.
float image_share(SpecularLobe lobe)
{
    vec3 n = normalize_or(normal_world, vec3(0.0, 1.0, 0.0)) * (gl_FrontFacing ? 1.0 : -1.0);
    Openness open = openness_from_mean(n, mat3(frame.world_from_models) * lightmap_texel(LIGHTMAP_OPENNESS));
    return visibility(open, (1.0 - lobe.spread) * normalize(lobe.towards));
}

// What the round lobe of single scattering takes from all around: of the image of probes and panorama as far as the lightmap knows
// the lobe's direction to be open; in the rest what surfaces before it give, as if it came from all of them evenly. `over_pi`: all
// irradiance over pi.
vec3 mirrored(Surface s, SpecularLobe lobe, vec3 over_pi)
{
    if (LIGHTMAP == LIGHTMAP_NONE)
        return round_reflectance(lobe) * environment_image(lobe) * s.occlusion;
    float left = 1.0; // the share that no probe gives
    vec4 room = vec4(vec3(0.0), 1.0);
#ifdef LOCAL_PROBES
    room = probes_image(lobe, position_world, left);
#endif
    vec3 panorama = room.a * environment_image(lobe), image = room.rgb + panorama;
    vec3 blockers = lightmap_texel(LIGHTMAP_BLOCKERS);
    // Of a room's image no light is known to come from what stands before it: it only dims that.
    blockers = mix(min(blockers, image), blockers, left);
    vec3 radiance = mix(blockers, image, image_share(lobe));
    float most = most_radiance(lobe.spread, dot(s.n, normalize(lobe.towards)));
    vec3 bound = image_bound(panorama, over_pi, environment_even(s.n).over_pi, most);
    vec3 spheres = vec3(0.0);
#ifdef LOCAL_PROBES
    spheres = mirrored_spheres(s, lobe.even, normal_variance());
#endif
    return round_reflectance(lobe) * min(radiance, bound) + spheres;
}

// What single scattering takes of all around; `over_pi`: all irradiance over pi.
vec3 single_environment(Surface s, SpecularLobe lobe, vec3 over_pi)
{
    return mirrored(s, lobe, over_pi) + lobe.reflectance * lobe.even * over_pi;
}

// The same of stretched highlights: taps with half vectors tilted along the stretch, each of an equal share of the slopes that make
// the lobe longer than it is wide, with a round lobe of its width around it. Slopes along one direction, over alpha, are
// u / sqrt(1 - u^2) for even u: GGX's marginal. Each tap also covers the slopes up to its neighbours, and counts by how much its
// microfacets face the eye and by what of their light is not shadowed. There are as many as the lobe is longer than wide: on a ball
// of roughness 0.3 that is stretched by 0.8 the error is then that of a round lobe, 6 %.
const float LEAST_TAPS = 4.0, MOST_TAPS = 24.0, TAPS_PER_WIDTH = 4.0;

vec3 stretched_environment(Surface s, SpecularLobe whole, vec3 over_pi)
{
    vec3 across = cross(s.n, s.stretch);
    float longer2 = s.alphas.x * s.alphas.x - s.alphas.y * s.alphas.y, longer = sqrt(max(longer2, 0.0));
    float taps = clamp(ceil(TAPS_PER_WIDTH * longer / max(s.alphas.y, TINY)), LEAST_TAPS, MOST_TAPS), weights = 0.0;
    vec3 sum = vec3(0.0);
    for (float i = 0.5; i < taps; ++i) {
        float u = 2.0 * i / taps - 1.0, cosine2 = 1.0 - u * u;
        float slope = longer * u * inversesqrt(cosine2), step = longer * inversesqrt(cosine2) / (cosine2 * taps);
        Surface tap = s;
        tap.n = normalize(s.n + slope * s.stretch);
        vec3 l = reflect(-s.v, tap.n);
        l = vec3(dot(l, s.stretch), dot(l, across), dot(l, s.n));
        float up = max(l.z, MIN_COS), shadowing = l.z > 0.0 ? 2.0 * up / (up + length(vec3(s.alphas * l.xy, up))) : 0.0;
        float weight = max(s.nv + slope * dot(s.stretch, s.v), 0.0) * shadowing;
        tap.nv = clamp(dot(tap.n, s.v), MIN_COS, 1.0);
        tap.roughness = sqrt(sqrt(min(s.alphas.y * s.alphas.y + step * step / 3.0, 1.0)));
        SpecularLobe lobe = lobe_of(tap);
        lobe.reflectance = whole.reflectance;
        lobe.apart = vec3(0.0); // narrow enough for one
        if (weight > 0.0) {
            sum += weight * single_environment(unstretched(tap), lobe, over_pi);
            weights += weight;
        }
    }
    return sum / max(weights, TINY);
}

// What the environment gives the surface below its sheen: the split sum, and with the irradiance what is diffuse or scattered more
// than once. That is exact under even light; elsewhere these terms' share of grazing light is fitted (energy.glsl).
Split environment_below(Surface s, SpecularLobe lobe)
{
    EvenLight light = even_light(s);
    vec3 even = light.over_pi;
    vec3 single = ANISOTROPY && s.stretch != vec3(0.0) ? stretched_environment(s, lobe, even) : single_environment(s, lobe, even);
    Split split = Split(vec3(0.0), single);
    bool multiple = MULTI_SCATTER && GEOMETRY == GEOMETRY_SMITH;
    if (METALNESS == METALNESS_METAL && !multiple)
        return split;
    Energy energy = Energy(lobe.mean_entry, multiple, s.dielectric);
    if (DIFFUSE_TRANSMISSION)
        split.diffuse = s.diffuse_transmission * left_by_dielectric(energy, lobe.entry) * soft_light_behind(s);
    if (GEOMETRY == GEOMETRY_KARIS2013) // the thesis's: what the mixed specular part leaves
        split.diffuse += (1.0 - lobe.reflectance) * (1.0 - s.metallic) * s.base_color * even;
    else if (METALNESS != METALNESS_METAL)
        split.diffuse += diffuse_even(energy, s.base_color, s.metallic, lobe.entry) * diffuse_taken(s.roughness, light.grazing) * even;
    if (multiple)
        split.specular += multiple_even(energy, s.base_color, s.metallic, lobe.entry) * multiple_taken(s.roughness, light.grazing) * even;
    return split;
}

// What sheen scatters of the environment. Of a panorama it takes what is around the mean of its directions; a lightmap knows no
// directions.
vec3 sheen_even(Surface s, float albedo)
{
    if (LIGHTMAP != LIGHTMAP_NONE)
        return s.sheen * albedo * even_light(s).over_pi;
    vec3 towards = sheen_towards(s.n, s.v, s.nv, s.sheen_roughness);
    return s.sheen * albedo * environment_even(towards).over_pi * s.occlusion;
}

// The same with the sheen over it.
Split environment(Surface s, SpecularLobe lobe)
{
    Split split = environment_below(s, lobe);
    if (SHEEN) {
        float albedo = sheen_albedo(s.nv, s.sheen_roughness), left = under_sheen(s.sheen, albedo);
        split.diffuse *= left;
        split.specular = left * split.specular + sheen_even(s, albedo);
    }
    return split;
}

// The surface for point lights, with its lobe widened: lights of no size would flash on edges and rims thinner than a pixel.
Surface widened_for_point_lights(Surface s, float variance)
{
    s.roughness = widened_roughness(s.roughness, variance);
    s.alphas = widened_alphas(s.alphas, variance);
    return s;
}

// What a clear coat leaves of the light of what is below.
float left_by_clearcoat(Surface s, Surface coat)
{
    Energy energy = Energy(table_mean(brdf_table, coat.roughness), MULTI_SCATTER, CLEARCOAT_FRESNEL);
    return under_clearcoat(s.clearcoat, energy, table_entry(brdf_table, coat.nv, coat.roughness));
}

// What the environment gives all layers.
Split layered_environment(Surface s)
{
    Split split = environment(s, lobe_of(s));
    if (CLEARCOAT) {
        Surface coat = clearcoat_layer(s);
        float left = left_by_clearcoat(s, coat);
        split.diffuse *= left;
        split.specular = left * split.specular + s.clearcoat * environment(coat, lobe_of(coat)).specular;
    }
    return split;
}

// What diffuses through of the light of lamps and the sun on the other side.
vec3 direct_light_behind(Surface s, Energy energy, vec2 at_v)
{
    vec3 irradiance = point_lights_behind(s, position_world);
    if (SUN)
        irradiance += sun_irradiance(-s.n, -triangle_normal());
    float left = left_by_dielectric(energy, at_v);
    if (SHEEN)
        left *= under_sheen(s.sheen, sheen_albedo(s.nv, s.sheen_roughness));
    return s.diffuse_transmission * (left * INV_PI) * irradiance;
}

// What one layer sends to the eye of all light.
vec3 layer_light(Surface s)
{
    SpecularLobe lobe = lobe_of(s);
    Split split = environment(s, lobe);
    Energy energy = Energy(lobe.mean_entry, MULTI_SCATTER, s.dielectric);
    float variance = normal_variance();
    vec3 points = point_lights(widened_for_point_lights(s, variance), position_world, energy, lobe.entry);
    if (DIFFUSE_TRANSMISSION)
        split.diffuse += direct_light_behind(s, energy, lobe.entry);
    return split.diffuse + split.specular + points + sun_light(s, variance, energy, lobe.entry);
}

vec3 physically_based(Surface s)
{
    vec3 light = layer_light(s);
    if (!CLEARCOAT)
        return light;
    Surface coat = clearcoat_layer(s);
    return left_by_clearcoat(s, coat) * light + s.clearcoat * layer_light(coat);
}

// D, F and G for the first light, or for one at the eye if the scene has none.
vec3 term(Surface s)
{
    vec3 l = s.v;
    if (frame.light_count > 0u)
        light_irradiance(scene_light(0u), position_world, l);
    float nl = max(dot(s.n, l), 0.0);
    vec3 h = s.v + l;
    if (SHADING == SHADING_F)
        return reflectance(fresnel_of(s), 0.5 * length(h));
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
        return phong(s) + s.emission;
    if (SHADING == SHADING_DIFFUSE)
        return layered_environment(s).diffuse;
    if (SHADING == SHADING_SPECULAR)
        return layered_environment(s).specular;
    if (SHADING == SHADING_IRRADIANCE)
        return environment_even(s.n).over_pi;
    return physically_based(s) + s.emission;
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
    if (SHADING == SHADING_BASE_COLOR)
        colour = display_colour(s.base_color);
    else if (shows_light)
        colour = display_radiance(REFRACTS ? with_what_is_seen_through(s, light_of(s)) : light_of(s));
    else
        colour = display_value(value_of(s));
    colour.a = s.alpha;
#ifdef TWO_SOURCES
    colour.rgb *= s.alpha;
    behind = vec4((1.0 - s.alpha) * s.transmission, 1.0 - s.alpha);
#else
    if (TINTS) { // what goes through is as bright, but keeps its colour
        colour.a = 1.0 - (1.0 - s.alpha) * luminance(s.transmission);
        colour.rgb *= s.alpha / max(colour.a, TINY);
    }
#endif
#ifdef LATE_DEPTH
    gl_FragStencilRefARB = 0; // no stencil is tested: see Gpu::wants_late_depth
#endif
}

#endif
