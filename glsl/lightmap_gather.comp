// Soft light at each texel: all that comes from other surfaces and from the panorama without its sun.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

// Texels across the panorama for light that samples of a hemisphere miss each other by.
const float PANORAMA_TEXELS = 256.0;
// Samples of the cosine for each one of the panorama: divides the samples of every pass.
const uint PER_DRAWN = 2;

// How a surface takes light from a direction at that cosine, 1 on average over even light: a dielectric's diffuse part takes less of
// grazing light, of which its specular part has more. Irradiance so weighted is what shading multiplies by the part's share of
// even light (energy.glsl).
float taken(Surface s, Energy energy, float cosine)
{
    float share = left_by_dielectric(energy, table_entry(brdf_table, max(cosine, 0.0), s.roughness));
    return mix(share / max(left_by_dielectric(energy, energy.mean), LEAST_LOST), 1.0, s.metallic);
}

// Irradiance by way of a relay, and its direction, for a point that samples its hemisphere by the cosine: see path.glsl's `relayed_light`.
vec3 relay_light(PathPoint p, vec3 origin, Relay relay, out vec3 l)
{
    vec3 to_relay = relay.position - origin;
    float squared = max(dot(to_relay, to_relay), TINY), far = sqrt(squared);
    l = to_relay / far;
    float cosine = dot(p.s.n, l), area = -dot(relay.side, l) / squared;
    if (cosine <= 0.0 || area <= 0.0 || dot(p.side, l) <= 0.0 || relay.density <= 0.0)
        return vec3(0.0);
    if (relay.glossy_triangle > 0u)
        relay.radiance = glossy_radiance(RayHit(far, relay.glossy_triangle - 1u, relay.weights), l, relay.density);
    // Light that comes twice from beside a lamp, as within its shade, is as hard to find.
    vec3 soft = textureLod(given_back_of_soft, relay.address, 0.0).rgb;
    vec3 light = (relay.radiance + soft) * (cosine * area / (cosine * INV_PI * area + relay.density));
    return light == vec3(0.0) || trace_ray(origin, l, far * (1.0 - 1e-5), true).t >= 0.0 ? vec3(0.0) : light;
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
    float density = cosine * INV_PI + (drawn ? panorama_density(panorama_from_world(d)) / float(PER_DRAWN) : 0.0);
    return sky_radiance(d, panorama_lod(PANORAMA_TEXELS)) * (cosine / max(density, TINY));
}

// The same from a direction drawn from the panorama, `seen` of it where nothing blocks it.
vec3 drawn_sky_light(PathPoint p, vec3 origin, uvec4 bits, out vec3 d, out vec3 seen)
{
    d = world_from_panorama(sample_panorama(bits));
    vec3 light = sky_light(p.s.n, d, true);
    bool blocked = light == vec3(0.0) || dot(p.side, d) <= 0.0 || trace_ray(origin, d, 1e30, true).t >= 0.0;
    seen = blocked ? vec3(0.0) : light;
    return light;
}

// Irradiance from one direction, over the density of cosine samples, or `sky`; false where no one sees it.
bool gathered(PathPoint p, RayHit hit, vec3 d, vec3 sky, out vec3 light)
{
    light = sky;
    if (hit.t < 0.0)
        return true;
    if (is_never_seen(hit, d))
        return false;
    vec3 at = lightmap_address(hit, is_back(hit, d));
    vec4 direct = textureLod(given_back_of_direct, at, 0.0), soft = textureLod(given_back_of_soft, at, 0.0);
    if (soft.a > 0.5)
        direct.rgb = glossy_radiance(hit, d, direct.a);
    vec3 g = normalize_or(bvh_normal(hit.triangle), vec3(0.0));
    float area = abs(dot(g, d * mat3(frame.world_from_models))) / max(hit.t * hit.t, TINY);
    float here = max(dot(p.s.n, d), 0.0) * INV_PI * area;
    // Relays give the rest, and points that are drawn of what shines.
    float share = work.relay_count > 0u ? here / max(here + direct.a, TINY) : 1.0;
    light = PI * share * (direct.rgb + soft.rgb);
    if (emitter_count > 0u)
        light += PI * emission_of_hit(hit) * (here / max(here + emitter_density(hit.triangle), TINY));
    return true;
}

// Irradiance of a point of what shines, and its direction, for a point that samples its hemisphere by the cosine.
vec3 emitter_irradiance(PathPoint p, vec2 u, out vec3 l)
{
    EmitterLight light;
    l = p.s.n;
    if (!emitter_light(p, u, light))
        return vec3(0.0);
    l = light.l;
    float cosine = dot(p.s.n, l);
    return light.radiance * (cosine * light.area / max(cosine * INV_PI * light.area + light.density, TINY));
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

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    LightmapTexel texel = lightmap_texels[index];
    uvec4 scramble = pcg4d(uvec4(index, 0u, 1u, 0u));
    uint places = lightmap_surfaces[index].places, count = uint(bitCount(places));
    BvhTriangle triangle = bvh_triangles[texel.triangle & ~LIGHTMAP_BACK];
    vec3 edge = mat3(frame.world_from_models) * (triangle.b - triangle.a);
    // The share that leaves the least noise: by the squares of what is seen, so that a bright window counts that is hidden.
    bool counts = (work.flags & WORK_COUNTS) != 0u;
    vec2 seen_sky = counts ? lightmap_surfaces[index].sky : lightmap_surfaces[index].kept.xy, met_sky = vec2(0.0);
    float open = seen_sky.y > 0.0 ? seen_sky.x / seen_sky.y : 0.0;
    // Where no sample has met the sky, nor one of the texels around once those of bounces are known, none is drawn from it;
    // without a table (0 cells) nowhere.
    bool sees_sky = cells_size.x > 0u && (seen_sky.x > 0.0 || seen_sky.y == 0.0);
    vec4 sum = vec4(0.0), unblocked = vec4(0.0);
    vec3 surfaces = vec3(0.0);
    float uneven = 0.0;
    for (uint i = work.first_sample; i < work.first_sample + work.samples && count > 0u; ++i) {
        float random = unit_from_bits(pcg4d(uvec4(index, i, 2u, 0u)).x);
        uint place = nth_bit(places, min(uint(random * float(count)), count - 1u));
        RayHit hit = texel_hit(texel, texel_place(index, place));
        PathPoint p = texel_point(hit, (texel.triangle & LIGHTMAP_BACK) != 0u);
        vec3 origin = ray_origin(p);
        vec3 d = frame_along(p.s.n, edge) * cosine_direction(sobol(i, scramble.xy));
        vec3 sky = sky_light(p.s.n, d, sees_sky), light, l;
        RayHit met = trace_ray(origin, d, 1e30, false);
        if (!gathered(p, met, d, sky, light))
            continue;
        Energy energy = Energy(table_mean(brdf_table, p.s.roughness), MULTI_SCATTER);
        vec3 all = taken(p.s, energy, dot(p.s.n, d)) * light, from_surfaces = met.t < 0.0 ? vec3(0.0) : light;
        unblocked += met.t < 0.0 ? vec4(d * mat3(frame.world_from_models), 1.0) : vec4(0.0);
        float bright = dot(sky_radiance(d, panorama_lod(PANORAMA_TEXELS)), vec3(1.0));
        met_sky += bright * bright * vec2(met.t < 0.0 ? 1.0 : 0.0, 1.0);
        if (sees_sky && i % PER_DRAWN == 0u) {
            vec3 seen;
            uvec4 bits = uvec4(sobol_bits(i / PER_DRAWN, scramble.zw), pcg4d(uvec4(index, i, 5u, 0u)).xy);
            sky += drawn_sky_light(p, origin, bits.xzyw, l, seen);
            all += taken(p.s, energy, dot(p.s.n, l)) * seen;
        }
        // What is known without samples is an open sky's irradiance: `sky` is these samples' estimate of it, and stands for as much
        // as the sky's light comes through here. A control variate: Owen, "Monte Carlo theory, methods and examples" (2013), section 8.9.
        if (open > 0.0)
            all += open * (open_sky_irradiance(p.s.n) - sky);
        if (work.relay_count > 0u) {
            light = relay_light(p, origin, relays[(i ^ scramble.y) % work.relay_count], l);
            from_surfaces += light;
            all += taken(p.s, energy, dot(p.s.n, l)) * light;
        }
        if (emitter_count > 0u) {
            light = emitter_irradiance(p, sobol(i, pcg4d(uvec4(index, 0u, 6u, 0u)).xy), l);
            from_surfaces += light;
            all += taken(p.s, energy, dot(p.s.n, l)) * light;
        }
        surfaces += from_surfaces;
        sum += vec4(all, 1.0);
        // Halves that have equally many samples of the panorama.
        float bright_light = brightness(all);
        uneven += (i / PER_DRAWN) % 2u == 0u ? -bright_light : bright_light;
    }
    // Not before surfaces give back nearly all they will.
    if (!counts || (work.flags & WORK_KEEPS) != 0u) {
        lightmap_surfaces[index].unblocked += unblocked;
        lightmap_surfaces[index].rays += sum.a;
        lightmap_surfaces[index].surfaces += surfaces;
    }
    if (counts)
        lightmap_surfaces[index].sky += met_sky;
    bool begins = (work.flags & WORK_BEGINS) != 0u;
    lightmap_sums[index] = begins ? sum : lightmap_sums[index] + sum;
    lightmap_surfaces[index].uneven = begins ? uneven : lightmap_surfaces[index].uneven + uneven;
}
