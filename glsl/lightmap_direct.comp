// What each texel gives back of the light that comes straight from lamps and the sun, and from what shines where that has relays.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

// Of light from l, what is given back as if all of that were matt.
vec3 given_back_of(Surface s, vec3 l)
{
    Energy energy = Energy(table_mean(brdf_table, s.roughness), MULTI_SCATTER, s.dielectric);
    float nl = max(dot(s.n, l), 0.0);
    vec2 at = table_entry(brdf_table, nl, s.roughness);
    return layered_albedo(s, nl, max(dot(s.clearcoat_n, l), 0.0), total_albedo(energy, s.base_color, s.metallic, at)) * INV_PI;
}

// Radiance given back of a lamp, 0 where something blocks it; `density`: of its relays there.
vec3 given_back_of_lamp(PathPoint p, PointLight lamp, out float density)
{
    vec3 l;
    vec3 irradiance = light_irradiance(lamp, p.position, l) * max(dot(p.s.n, l), 0.0);
    float far = distance(lamp.position, p.position), cosine = dot(p.side, l);
    density = 0.0;
    vec3 transmission = cosine > 0.0 ? ray_transmission(ray_origin(p), l, far) : vec3(0.0);
    if (transmission == vec3(0.0))
        return vec3(0.0);
    density = lamp_density(cosine, far);
    return given_back_of(p.s, l) * transmission * irradiance;
}

// The same of the sun, by one of its disc's points.
vec3 given_back_of_sun(PathPoint p, vec2 u)
{
    vec3 l = sample_disc(u, frame.sun.towards, frame.sun.sine);
    float cosine = dot(p.s.n, l);
    if (cosine <= 0.0 || dot(p.side, l) <= 0.0)
        return vec3(0.0);
    vec3 irradiance = frame.sun.irradiance * ray_transmission(ray_origin(p), l, 1e30);
    return irradiance != vec3(0.0) ? given_back_of(p.s, l) * irradiance * cosine : vec3(0.0);
}

// The same of lamps and the sun on the other side, whose light diffuses through; of a dielectric's mean.
vec3 given_back_from_behind(PathPoint p, vec2 u)
{
    Energy energy = Energy(table_mean(brdf_table, p.s.roughness), MULTI_SCATTER, p.s.dielectric);
    PathPoint behind = p;
    behind.s = other_side(p.s, left_by_dielectric(energy, energy.mean));
    behind.side = -p.side;
    vec3 given = vec3(0.0);
    float density;
    for (uint lamp = 0u; lamp < lamp_count(); ++lamp)
        given += given_back_of_lamp(behind, lights[lamp], density);
    return frame.sun.irradiance != vec3(0.0) ? given + given_back_of_sun(behind, u) : given;
}

const uint PROBES = 8;

// Whether one of some rays from a place says that no one sees it.
bool is_hidden(PathPoint p, uint probes, uvec4 seed)
{
    for (uint i = 0u; i < probes; ++i) {
        uvec4 bits = pcg4d(seed + uvec4(0u, 0u, 0u, i));
        vec3 d = basis(p.s.n) * cosine_direction(units_from_bits(bits.xy));
        RayHit hit = trace_ray(ray_origin(p), d, 1e30, false);
        if (hit.t >= 0.0 && is_never_seen(hit, d))
            return true;
    }
    return false;
}

// Those of a texel's places that are seen: one ray from each, and where some is hidden more.
uint seen_places(LightmapTexel texel, uint index)
{
    uint all = (1u << work.samples) - 1u, seen = all;
    for (uint probes = 1u; probes <= PROBES && (probes == 1u || seen != all); probes += PROBES - 1u) {
        for (uint i = 0u; i < work.samples; ++i) {
            PathPoint p = texel_point(texel_hit(texel, texel_place(index, i)), (texel.triangle & LIGHTMAP_BACK) != 0u);
            if ((seen >> i & 1u) != 0u && is_hidden(p, probes, uvec4(index, i, 3u, probes << 8u)))
                seen &= ~(1u << i);
        }
    }
    return seen;
}

// What comes straight from all that shines.
struct Shining {
    vec3 given;    // radiance given back of it
    float density; // of its relays
};

// Adds one point of it or one direction, seen along l: `density` of such points and `here` of such directions per area, `area`: solid
// angle per area, `side`: see emitted_to_side. The balance heuristic, as in importance.glsl.
void add(inout Shining sum, PathPoint p, vec3 l, vec3 radiance, float density, float area, float side)
{
    float here = max(dot(p.side, l), 0.0) * INV_PI * area, weight = 1.0 / max(density + here, TINY);
    sum.given += given_back_of(p.s, l) * radiance * (max(dot(p.s.n, l), 0.0) * area * weight);
    sum.density += side * density * here * weight;
}

// Samples of it for a texel that has more relays than work.spot_density: their density must be known well there.
const uint SPOT_SAMPLES = 128;

// Means over a texel's places, both by the same samples: relays give the one divided by the other.
Shining shining(LightmapTexel texel, uint index, uint seen)
{
    uvec4 scrambles = pcg4d(uvec4(index, 0u, 7u, 0u));
    Shining sum = Shining(vec3(0.0), 0.0);
    float count = 0.0;
    bool is_spot = true;
    for (uint i = 0u; i < SPOT_SAMPLES && is_spot; ++i) {
        uint place = i % work.samples;
        is_spot = place + 1u < work.samples || sum.density > work.spot_density * count;
        if ((seen >> place & 1u) == 0u && seen != 0u)
            continue;
        PathPoint p = texel_point(texel_hit(texel, texel_place(index, place)), (texel.triangle & LIGHTMAP_BACK) != 0u);
        EmitterLight light;
        if (emitter_light(p, sobol(i, scrambles.xy), light))
            add(sum, p, light.l, light.radiance, light.density, light.area, light.side);
        vec3 d = basis(p.side) * cosine_direction(sobol(i, scrambles.zw));
        RayHit hit = trace_ray(ray_origin(p), d, 1e30, false);
        if (hit.t >= 0.0) {
            float area = hit_cosine(hit, d) / max(hit.t * hit.t, TINY), side = emitted_to_side(hit.triangle, is_back(hit, d));
            vec3 radiance = emission_of_hit(hit) * hit.transmission;
            add(sum, p, d, radiance, radiance != vec3(0.0) ? emitter_density(hit.triangle) : 0.0, area, side);
        }
        count += 1.0;
    }
    float scale = 1.0 / max(count, 1.0);
    return Shining(scale * sum.given, scale * sum.density);
}

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    LightmapTexel texel = lightmap_texels[index];
    uvec2 scramble = pcg4d(uvec4(index, 0u, 4u, 0u)).xy;
    uint lamps = lamp_count();
    vec3 given = vec3(0.0), albedo = vec3(0.0), through = vec3(0.0), place = vec3(0.0), normal = vec3(0.0);
    float density = 0.0, glossy = 0.0;
    uint seen = seen_places(texel, index);
    for (uint i = 0u; i < work.samples; ++i) {
        if ((seen >> i & 1u) == 0u && seen != 0u)
            continue;
        RayHit hit = texel_hit(texel, texel_place(index, i));
        PathPoint p = texel_point(hit, (texel.triangle & LIGHTMAP_BACK) != 0u);
        for (uint lamp = 0u; lamp < lamps; ++lamp) {
            float of_lamp;
            given += given_back_of_lamp(p, lights[lamp], of_lamp);
            density += of_lamp / float(lamps);
        }
        if (frame.sun.irradiance != vec3(0.0))
            given += given_back_of_sun(p, sobol(i, scramble));
        if (rays_have(RAYS_DIFFUSE_TRANSMISSION) && p.s.diffuse_transmission != vec3(0.0)) {
            given += given_back_from_behind(p, sobol(i, scramble));
            through += p.s.diffuse_transmission;
        }
        albedo += matt_albedo(p.s);
        place += p.position;
        normal += p.s.n;
        glossy += is_glossy(p.s) ? 1.0 : 0.0;
    }
    float scale = 1.0 / float(seen != 0u ? uint(bitCount(seen)) : work.samples);
    glossy *= scale;
    given *= scale;
    density *= scale;
    if (rays_have(RAYS_RELAYS) && has_emitters()) {
        Shining light = shining(texel, index, seen);
        given += has_direct_shining(glossy) ? light.given : vec3(0.0);
        density = mix(density, light.density, relays_of_emitters());
    }
    imageStore(direct_image, texel_address(texel), vec4(min(given, HALF_MOST), min(density, HALF_MOST)));
    imageStore(soft_image, texel_address(texel), vec4(vec3(0.0), glossy));
    vec3 n = normalize_or(normal, vec3(0.0, 1.0, 0.0));
    lightmap_surfaces[index] = LightmapSurface(vec4(albedo * scale, glossy), through * scale, seen, place * scale, n, texel_extent(texel),
        vec4(0.0), 0.0, vec3(0.0));
    lightmap_sums[index] = LightmapSums(vec4(0.0), 0.0, vec4(0.0), vec3(0.0), vec2(0.0), vec4(0.0), vec4(0.0));
}
