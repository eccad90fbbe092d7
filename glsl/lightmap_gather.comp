// Soft light at each texel: all that comes from other surfaces and from the panorama without its sun.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

// Texels across the panorama for light that samples of a hemisphere miss each other by.
const float PANORAMA_TEXELS = 256.0;
// Samples of the cosine for each one of the panorama: divides the samples of every pass.
const uint PER_DRAWN = 2;

// Irradiance by way of a relay, for a point that samples its hemisphere by the cosine: see path.glsl's `relayed_light`.
vec3 relay_light(PathPoint p, vec3 origin, Relay relay)
{
    vec3 to_relay = relay.position - origin;
    float squared = max(dot(to_relay, to_relay), TINY), far = sqrt(squared);
    vec3 l = to_relay / far;
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

// What is known without samples: an open sky's irradiance, as much of it as its light comes through; samples find the rest.
// `sky`: the same sample's estimate of it.
// A control variate: Owen, "Monte Carlo theory, methods and examples" (2013), section 8.9.
vec3 beside_open_sky(vec3 n, vec3 light, vec3 sky, float open)
{
    vec3 all = textureLod(irradiance_over_pi, panorama_from_world(n), 0.0).rgb * frame.environment_scale;
    return light + open * (PI * all - sky);
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
vec3 drawn_sky_light(PathPoint p, vec3 origin, uvec4 bits, out vec3 seen)
{
    vec3 d = world_from_panorama(sample_panorama(bits)), light = sky_light(p.s.n, d, true);
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

// Irradiance of a point of what shines, for a point that samples its hemisphere by the cosine.
vec3 emitter_irradiance(PathPoint p, vec2 u)
{
    EmitterLight light;
    if (!emitter_light(p, u, light))
        return vec3(0.0);
    float cosine = dot(p.s.n, light.l);
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
        vec3 sky = sky_light(p.s.n, d, sees_sky), light;
        RayHit met = trace_ray(origin, d, 1e30, false);
        if (!gathered(p, met, d, sky, light))
            continue;
        vec3 from_sky = met.t < 0.0 ? light : vec3(0.0), from_surfaces = light - from_sky;
        unblocked += met.t < 0.0 ? vec4(d * mat3(frame.world_from_models), 1.0) : vec4(0.0);
        float bright = dot(sky_radiance(d, panorama_lod(PANORAMA_TEXELS)), vec3(1.0));
        met_sky += bright * bright * vec2(met.t < 0.0 ? 1.0 : 0.0, 1.0);
        if (sees_sky && i % PER_DRAWN == 0u) {
            vec3 seen;
            uvec4 bits = uvec4(sobol_bits(i / PER_DRAWN, scramble.zw), pcg4d(uvec4(index, i, 5u, 0u)).xy);
            sky += drawn_sky_light(p, origin, bits.xzyw, seen);
            from_sky += seen;
        }
        if (open > 0.0)
            from_sky = beside_open_sky(p.s.n, from_sky, sky, open);
        if (work.relay_count > 0u)
            from_surfaces += relay_light(p, origin, relays[(i ^ scramble.y) % work.relay_count]);
        if (emitter_count > 0u)
            from_surfaces += emitter_irradiance(p, sobol(i, pcg4d(uvec4(index, 0u, 6u, 0u)).xy));
        surfaces += from_surfaces;
        sum += vec4(from_sky + from_surfaces, 1.0);
        // Halves that have equally many samples of the panorama.
        float bright_light = brightness(from_sky + from_surfaces);
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
