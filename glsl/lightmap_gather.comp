// Soft light at each texel: all that comes from other surfaces and from the panorama without its sun.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"
#include "placed_probes.glsl"

// Texels across the panorama for light that samples of a hemisphere miss each other by.
const float PANORAMA_TEXELS = 256.0;
// Samples of the cosine for each one of the panorama: divides the samples of every pass.
const uint PER_DRAWN = 2;

// How much light from a direction counts for, 1 on average over even light.
struct Weights {
    float diffuse; // for what shading multiplies by the diffuse part's share of even light (energy.glsl)
    vec3 given;    // for all that is given back
};

// A dielectric's diffuse part takes less of grazing light, of which its specular part has more.
Weights weights(Surface s, Energy energy, float cosine)
{
    vec2 at_l = table_entry(brdf_table, max(cosine, 0.0), s.roughness);
    float share = left_by_dielectric(energy, at_l) / max(left_by_dielectric(energy, energy.mean), LEAST_LOST);
    return Weights(mix(share, 1.0, s.metallic), over_matt(energy, s.base_color, s.metallic, at_l));
}

// Light that no bounce changes, and that of the bounce before.
struct Light {
    vec3 steady;
    vec3 bounced;
};

// Radiance that a hit gives back to where a ray of direction d came from, of what its texel says of direct and soft light. Where it is
// glossy, that of lamps and sun and the density of their relays are those of the very place.
Light given_towards(RayHit hit, vec3 d, float cosine, vec3 direct, vec3 soft, bool glossy, inout float density)
{
    vec3 towards = towards_over_matt(hit, cosine);
    direct *= towards;
    if (rays_have(RAYS_GLOSSY) && glossy) {
        float of_lamps;
        direct = glossy_radiance(hit, d, of_lamps);
        density = has_emitters() ? density : of_lamps;
    }
    return Light(direct, towards * soft);
}

// Irradiance by way of a relay, its direction and how far it is, for a point that samples its hemisphere by the cosine: see
// path.glsl's `relayed_light`.
Light relay_light(PathPoint p, vec3 origin, Relay relay, out vec3 l, out float far)
{
    vec3 to_relay = relay.position - origin;
    float squared = max(dot(to_relay, to_relay), TINY);
    far = sqrt(squared);
    l = to_relay / far;
    float cosine = dot(p.s.n, l), area = -dot(relay.side, l) / squared;
    if (cosine <= 0.0 || area <= 0.0 || dot(p.side, l) <= 0.0 || relay.density <= 0.0)
        return Light(vec3(0.0), vec3(0.0));
    // Light that comes twice from beside a lamp, as within its shade, is as hard to find.
    vec3 soft = textureLod(given_back_of_soft, relay.address, 0.0).rgb;
    RayHit lit = RayHit(far, relay.triangle & ~RELAY_GLOSSY, relay.weights, vec3(1.0));
    bool glossy = (relay.triangle & RELAY_GLOSSY) != 0u;
    Light given = given_towards(lit, l, -dot(relay.side, l), relay.radiance, soft, glossy, relay.density);
    if (given.steady + given.bounced == vec3(0.0))
        return Light(vec3(0.0), vec3(0.0));
    vec3 transmission = ray_transmission(origin, l, far * (1.0 - 1e-5));
    vec3 scale = transmission * (cosine * area / (cosine * INV_PI * area + relay.density));
    return Light(scale * given.steady, scale * given.bounced);
}

vec3 open_sky_irradiance(vec3 n)
{
    return PI * textureLod(irradiance_over_pi, panorama_from_world(n), 0.0).rgb * frame.environment_scale;
}

// Irradiance of the open sky from one direction, over the density of all samples: of the cosine, and where `drawn` of the
// panorama. Balance heuristic: Veach, "Robust Monte Carlo Methods for Light Transport Simulation" (1997), section 9.2.2.
vec3 sky_light(vec3 n, vec3 d, bool drawn)
{
    float cosine = max(dot(n, d), 0.0);
    float density = cosine * INV_PI + (drawn ? panorama_density(panorama_from_world(d), 0u) / float(PER_DRAWN) : 0.0);
    return sky_radiance(d, panorama_lod(PANORAMA_TEXELS)) * (cosine / max(density, TINY));
}

// The same from a direction drawn from the panorama, `seen` of it where nothing blocks it.
vec3 drawn_sky_light(PathPoint p, vec3 origin, uvec4 bits, out vec3 d, out vec3 seen)
{
    d = world_from_panorama(sample_panorama(bits, 0u));
    vec3 light = sky_light(p.s.n, d, true);
    seen = vec3(0.0);
    if (light != vec3(0.0) && dot(p.side, d) > 0.0)
        seen = light * ray_transmission(origin, d, 1e30);
    return light;
}

// Irradiance from one direction, over the density of cosine samples, or `sky`; `shining`: of what is emitted there. False where no
// one sees it.
bool gathered(PathPoint p, RayHit hit, vec3 d, vec3 sky, out Light light, out vec3 shining)
{
    light = Light(sky * hit.transmission, vec3(0.0));
    shining = vec3(0.0);
    if (hit.t < 0.0)
        return true;
    if (is_never_seen(hit, d))
        return false;
    vec3 at = lightmap_address(hit, is_back(hit, d));
    vec4 direct = textureLod(given_back_of_direct, at, 0.0), soft = textureLod(given_back_of_soft, at, 0.0);
    float cosine = hit_cosine(hit, d), area = cosine / max(hit.t * hit.t, TINY);
    Light given = given_towards(hit, d, cosine, direct.rgb, soft.rgb, soft.a > 0.5, direct.a);
    float here = max(dot(p.s.n, d), 0.0) * INV_PI * area;
    // Relays give the rest, and points that are drawn of what shines.
    float share = rays_have(RAYS_RELAYS) ? here / max(here + direct.a, TINY) : 1.0;
    vec3 arriving = PI * share * hit.transmission;
    light = Light(arriving * given.steady, arriving * given.bounced);
    if (has_emitters())
        shining = PI * hit.transmission * emission_of_hit(hit) * (here / max(here + emitter_density(hit.triangle), TINY));
    return true;
}

// Irradiance of a point of what shines, its direction and how far it is, for a point that samples its hemisphere by the cosine.
vec3 emitter_irradiance(PathPoint p, vec2 u, out vec3 l, out float far)
{
    EmitterLight light;
    l = p.s.n;
    far = 0.0;
    if (!emitter_light(p, u, light))
        return vec3(0.0);
    l = light.l;
    far = light.far;
    float cosine = dot(p.s.n, l);
    return light.radiance * (cosine * light.area / max(cosine * INV_PI * light.area + light.density, TINY));
}

// The share of what a ray from p meets after t metres, or nothing (< 0), that mirror images of probes or panorama show there. Less
// where it meets something before the walls: that blocks it, and where no probe reaches, all does that is met.
float share_in_image(vec3 position, vec3 d, float t)
{
    if (t < 0.0)
        return 1.0;
    vec3 p = position_in_models(position), along = models_from_world(d);
    float left = 1.0, shown = 0.0;
    for (uint i = 0u; i < work.probe_count && left > 0.0; ++i) {
        float weight = left * probe_weight(p, probes[i]);
        shown += is_in_image(p, along, t, probes[i]) ? weight : 0.0;
        left -= weight;
    }
    return shown;
}

// A basis around n whose first axis lies along an edge: samples of one texel stay spread evenly only if the bases of all its
// places hang together, which `basis` does not where n.z changes its sign.
mat3 frame_along(vec3 n, vec3 edge)
{
    mat3 otherwise = basis(n);
    vec3 tangent = normalize_or(edge - dot(edge, n) * n, otherwise[0]);
    return mat3(tangent, cross(n, tangent), n);
}

// The nth bit that is set.
uint nth_bit(uint bits, uint n)
{
    for (; n > 0u; --n)
        bits &= bits - 1u;
    return uint(findLSB(bits));
}

// One of a texel's places that can be seen.
PathPoint seen_place(LightmapTexel texel, uint index, uint i)
{
    uint places = lightmap_surfaces[index].places, count = uint(bitCount(places));
    float random = unit_from_bits(pcg4d(uvec4(index, i, 2u, work.sequence)).x);
    uint place = nth_bit(places, min(uint(random * float(count)), count - 1u));
    return texel_point(texel_hit(texel, texel_place(index, place)), (texel.triangle & LIGHTMAP_BACK) != 0u);
}

// What a texel knows of the sky before it samples.
struct KnownSky {
    float open;    // the share of its light that comes through
    bool is_drawn; // whether directions are drawn from it, too
};

// By the squares of what is seen, so that a bright window counts that is hidden: the share that leaves the least noise. Where no
// sample has met the sky, nor one of the texels around once those of bounces are known, nothing is drawn from it; without a
// table (0 cells) nowhere.
KnownSky known_sky(vec2 seen)
{
    float open = seen.y > 0.0 ? seen.x / seen.y : 0.0;
    return KnownSky(open, cells_size.x > 0u && (seen.x > 0.0 || seen.y == 0.0));
}

// What one sample of a texel found.
struct GatheredLight {
    vec3 all;       // irradiance by all ways that light comes, weighted for the diffuse part
    vec3 steady;    // weighted for what is given back: what no bounce changes
    vec3 bounced;   // and the rest
    vec3 surfaces;  // irradiance from surfaces that no mirror image shows
    vec4 unblocked; // of a ray that meets what they show the models' direction, and 1
    vec2 sky;       // square of the sky's brightness along a ray that met nothing, and along any
};

void add(inout GatheredLight found, Weights w, Light light)
{
    found.all += w.diffuse * (light.steady + light.bounced);
    found.steady += w.given * light.steady;
    found.bounced += w.given * light.bounced;
}

// Of what is emitted: given back with direct light already, where texels have it there.
void add_shining(inout GatheredLight found, Weights w, vec3 light, float blocks, bool is_direct)
{
    found.surfaces += blocks * light;
    found.all += w.diffuse * light;
    found.steady += is_direct ? vec3(0.0) : w.given * light;
}

void add_steady(inout GatheredLight found, Weights w, vec3 light)
{
    add(found, w, Light(light, vec3(0.0)));
}

// False where no one sees the place. `bases`: of the texel's random numbers.
bool gather(PathPoint p, vec3 d, uint index, uint i, uvec4 bases, KnownSky known, out GatheredLight found)
{
    vec3 origin = ray_origin(p), sky = sky_light(p.s.n, d, known.is_drawn), l;
    Light light;
    vec3 shining;
    bool is_direct = has_direct_shining(lightmap_surfaces[index].albedo.a);
    RayHit met = trace_ray(origin, d, 1e30, false);
    if (!gathered(p, met, d, sky, light, shining))
        return false;
    Energy energy = Energy(table_mean(brdf_table, p.s.roughness), MULTI_SCATTER, p.s.dielectric);
    float is_sky = met.t < 0.0 ? 1.0 : 0.0, bright = dot(sky_radiance(d, panorama_lod(PANORAMA_TEXELS)), vec3(1.0));
    found.all = found.steady = found.bounced = vec3(0.0);
    add(found, weights(p.s, energy, dot(p.s.n, d)), light);
    float in_image = share_in_image(p.position, d, met.t), far;
    found.surfaces = (1.0 - in_image) * (light.steady + light.bounced);
    add_shining(found, weights(p.s, energy, dot(p.s.n, d)), shining, 1.0 - in_image, is_direct);
    found.unblocked = in_image * vec4(models_from_world(d), 1.0);
    found.sky = bright * bright * vec2(is_sky, 1.0);
    if (known.is_drawn && i % PER_DRAWN == 0u) {
        vec3 seen;
        uvec4 bits = uvec4(sobol_bits(i / PER_DRAWN, bases.zw), pcg4d(uvec4(index, i, 5u, work.sequence)).xy);
        sky += drawn_sky_light(p, origin, bits, l, seen);
        add_steady(found, weights(p.s, energy, dot(p.s.n, l)), seen);
    }
    // An open sky's irradiance is known without samples: it stands for as much of `sky`, these samples' estimate of it, as comes
    // through. A control variate: Owen, "Monte Carlo theory, methods and examples" (2013), section 8.9.
    if (known.open > 0.0)
        add_steady(found, Weights(1.0, vec3(1.0)), known.open * (open_sky_irradiance(p.s.n) - sky));
    if (rays_have(RAYS_RELAYS)) {
        light = relay_light(p, origin, relays[(i ^ bases.y) % work.relay_count], l, far);
        found.surfaces += (1.0 - share_in_image(p.position, l, far)) * (light.steady + light.bounced);
        add(found, weights(p.s, energy, dot(p.s.n, l)), light);
    }
    if (has_emitters()) {
        shining = emitter_irradiance(p, sobol(i, pcg4d(uvec4(index, 0u, 6u, work.sequence)).xy), l, far);
        add_shining(found, weights(p.s, energy, dot(p.s.n, l)), shining, 1.0 - share_in_image(p.position, l, far), is_direct);
    }
    return true;
}

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    LightmapTexel texel = lightmap_texels[index];
    uvec4 bases = pcg4d(uvec4(index, 0u, 1u, work.sequence));
    BvhTriangle triangle = bvh_triangle(texel.triangle & ~LIGHTMAP_BACK);
    vec3 edge = mat3(frame.world_from_models) * (triangle.b - triangle.a);
    bool counts = (work.flags & WORK_COUNTS) != 0u, is_seen = lightmap_surfaces[index].places != 0u;
    KnownSky known = known_sky(counts ? lightmap_sums[index].sky : lightmap_sums[index].kept.xy);
    GatheredLight sum = GatheredLight(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec4(0.0), vec2(0.0)), found;
    float samples = 0.0, uneven = 0.0;
    for (uint i = work.first_sample; i < work.first_sample + work.samples && is_seen; ++i) {
        PathPoint p = seen_place(texel, index, i);
        vec3 d = frame_along(p.s.n, edge) * cosine_direction(sobol(i, bases.xy));
        if (!gather(p, d, index, i, bases, known, found))
            continue;
        sum.all += found.all;
        sum.steady += found.steady;
        sum.bounced += found.bounced;
        sum.surfaces += found.surfaces;
        sum.unblocked += found.unblocked;
        sum.sky += found.sky;
        samples += 1.0;
        // The first half and the second, each spread evenly: of others that are not, the difference is no noise.
        float bright = brightness(found.all);
        uneven += i < work.half_of_samples ? -bright : bright;
    }
    // Not before surfaces give back nearly all they will.
    if (!counts || (work.flags & WORK_KEEPS) != 0u) {
        lightmap_surfaces[index].unblocked += sum.unblocked;
        lightmap_surfaces[index].rays += samples;
        lightmap_surfaces[index].surfaces += sum.surfaces;
    }
    if (counts)
        lightmap_sums[index].sky += sum.sky;
    bool begins = (work.flags & WORK_BEGINS) != 0u;
    vec4 all = vec4(sum.all, samples);
    lightmap_sums[index].all = begins ? all : lightmap_sums[index].all + all;
    lightmap_sums[index].steady += vec4(sum.steady, samples);
    lightmap_sums[index].bounced = begins ? sum.bounced : lightmap_sums[index].bounced + sum.bounced;
    lightmap_sums[index].uneven = begins ? uneven : lightmap_sums[index].uneven + uneven;
}
