// Light transport: what a point sends towards its viewer, by one random path with next-event estimation.
// Kajiya, "The Rendering Equation" (1986); Veach, "Robust Monte Carlo Methods for Light Transport Simulation" (1997).
#ifndef PATH_GLSL
#define PATH_GLSL

#include "shared.glsl"
#include "bodies.glsl"
#include "emitters.glsl"
#include "importance.glsl"
#include "lamp.glsl"
#include "ray_surface.glsl"
#include "scatter.glsl"
#include "sky_relay.glsl"
#include "transport.glsl"

// No real scene's paths get there: each bounce beyond the third survives with the path's own brightness as its chance.
const uint MOST_BOUNCES = 256;
const uint CERTAIN_BOUNCES = 3;
// Above it a path would go on for too long between white walls for what it adds.
const float MOST_SURVIVAL = 0.98;

// Whether light that comes straight along l to the first point is shown.
bool is_shown(bool straight)
{
    return PART == PART_ALL || straight == (PART == PART_DIRECT);
}

// `scattered`, at the first point only the part that is shown.
vec3 scattered_part(Scatter m, vec3 l, bool first)
{
    if (!first || PART == PART_ALL || PART == PART_DIRECT)
        return scattered(m, l);
    vec3 diffuse = scattered_diffuse(m, l);
    return PART == PART_SOFT_DIFFUSE ? diffuse : scattered(m, l) - diffuse;
}

// A point of a lamp's sphere for light to p. It shines by Lambert's law, and the mean of all points is the lamp; they are drawn
// by the cosine to the direction from the centre, and weighted for their own.
PointLight lamp_point(PointLight lamp, vec3 p, vec2 u)
{
    vec3 to_p = normalize_or(p - lamp.position, vec3(0.0, 1.0, 0.0));
    vec3 drawn = cosine_direction(u), n = basis(to_p) * drawn;
    lamp.position += lamp.radius * n;
    lamp.intensity *= max(dot(n, normalize_or(p - lamp.position, n)), 0.0) / max(drawn.z, MIN_COS);
    lamp.radius = 0.0;
    return lamp;
}

// What occlusion maps leave of light from a direction; as in pictures, they say nothing of a sun that is a light of its own.
float ambient_share(PathPoint p, vec3 d)
{
    return sun_density(d) > 0.0 ? 1.0 : p.s.occlusion;
}

// What a lamp adds, before anything blocks it, with the direction and distance to it.
vec3 lamp_light(PathPoint p, Scatter m, PointLight lamp, out vec3 l, out float far)
{
    vec3 irradiance = light_irradiance(lamp, p.position, l);
    far = distance(lamp.position, p.position);
    float nl = dot(p.s.n, l);
    if (nl <= 0.0)
        return vec3(0.0);
    vec3 sum = brdf(p.s, l, m.energy, m.at_v);
    sum = nl * (rays_have(RAYS_SHEEN) ? with_sheen(p.s, l, sum) : sum);
    if (rays_have(RAYS_CLEARCOAT)) {
        Surface coat = clearcoat_layer(p.s);
        sum = m.coat.left * sum + p.s.clearcoat * max(dot(coat.n, l), 0.0) * brdf(coat, l, m.coat.energy, m.coat.at_v);
    }
    return irradiance * sum;
}

// One sample of the panorama, weighted against `sample_scatter` by the balance heuristic (Veach (1997), eq. 9.8): with a
// sample from each of two densities, f / (p1 + p2) whichever it came from.
vec3 panorama_light(Scatter m, mat3 world_from_surface, uint place, uvec4 bits, bool first, out vec3 l, out float density)
{
    vec3 l_panorama = sample_panorama(bits, place);
    l = world_from_panorama(l_panorama);
    vec3 l_surface = l * world_from_surface;
    density = 0.0;
    if (l_surface.z <= 0.0)
        return vec3(0.0);
    density = scatter_density(m, l_surface) + panorama_density(l_panorama, place);
    if (density <= 0.0 || (first && !is_shown(sun_density(l) > 0.0)))
        return vec3(0.0);
    return scattered_part(m, l_surface, first) * panorama_radiance(l_panorama) / density;
}

// A surface as it is seen along l.
Surface seen_along(Surface s, vec3 l)
{
    s.v = -l;
    s.nv = clamp(dot(s.n, s.v), MIN_COS, 1.0);
    return s;
}

// How a path's point sees another one, which light was followed to.
struct Connection {
    vec3 l;         // unit vector to it
    vec3 l_surface; // the same in the local space of the path's point
    float area;     // solid angle per area
    float far;      // metres that must be free
};

// Whether they face each other.
bool is_connected(PathPoint p, mat3 world_from_surface, PathPoint lit, out Connection c)
{
    vec3 to_lit = lit.position - p.position;
    float squared = max(dot(to_lit, to_lit), TINY), far = sqrt(squared);
    c.l = to_lit / far;
    c.l_surface = c.l * world_from_surface;
    float cosine = -dot(lit.side, c.l), rounding = p.rounding + lit.rounding;
    c.area = cosine / squared;
    c.far = far - 2.0 * rounding;
    // Two points of one plane see each other by rounding only: the far side of a wall would give light to the near one.
    return c.l_surface.z > 0.0 && cosine * far > rounding && dot(p.side, to_lit) > rounding;
}

// A lamp at random, and how many there are.
PointLight any_lamp(uint bits, out float count)
{
    uint lamps = lamp_count();
    count = float(lamps);
    return lights[min(uint(unit_from_bits(bits) * count), lamps - 1u)];
}

// What a lamp adds by way of one other point, which light from the lamp is followed to. Paths from the eye find the bright
// spots beside a lamp too rarely; both ways of finding a point are weighted by the balance heuristic.
vec3 relayed_light(PathPoint p, Scatter m, mat3 world_from_surface, bool first, uvec4 bits)
{
    float count;
    PointLight lamp = any_lamp(bits.x, count);
    vec3 d = sphere_direction(units_from_bits(bits.yz));
    // Where light towards d leaves the lamp's sphere: by Lambert's law.
    lamp.position += lamp.radius * (basis(d) * cosine_direction(units_from_bits(pcg4d(bits).xy)));
    lamp.radius = 0.0;
    RayHit hit = trace_ray(lamp.position, d, 1e30, false);
    if (hit.t < 0.0)
        return vec3(0.0);
    PathPoint lit = ray_point(hit, d);
    Connection c;
    if (!is_connected(p, world_from_surface, lit, c))
        return vec3(0.0);
    float from_lamp = lamp_density(-dot(lit.side, d), hit.t);
    lit.s = seen_along(lit.s, c.l);
    Scatter of_lit = make_scatter(lit.s, surface_basis(lit.s));
    vec3 l_lamp;
    float lamp_far;
    vec3 radiance = lamp_light(lit, of_lit, lamp, l_lamp, lamp_far) * count;
    vec3 light = scattered_part(m, c.l_surface, first) * radiance * c.area
        / (scatter_density(m, c.l_surface) * c.area + from_lamp);
    return light != vec3(0.0) ? light * hit.transmission * ray_transmission(ray_origin(p), c.l, c.far) : light;
}

// The same for the panorama, which shines through windows that paths from the eye find too rarely.
vec3 relayed_sky(PathPoint p, Scatter m, mat3 world_from_surface, bool first, uvec4 bits)
{
    vec3 d, origin = relay_origin(bits, d);
    RayHit hit = trace_ray(origin, -d, 1e30, false);
    if (hit.t < 0.0)
        return vec3(0.0);
    PathPoint lit = ray_point(hit, -d);
    Connection c;
    if (!is_connected(p, world_from_surface, lit, c))
        return vec3(0.0);
    float from_sky = relay_density(lit.position, d, dot(lit.side, d));
    lit.s = seen_along(lit.s, c.l);
    mat3 world_from_lit = surface_basis(lit.s);
    Scatter of_lit = make_scatter(lit.s, world_from_lit);
    vec3 d_lit = d * world_from_lit, d_panorama = panorama_from_world(d);
    if (d_lit.z <= 0.0 || from_sky <= 0.0)
        return vec3(0.0);
    float of_sky = scatter_density(of_lit, d_lit) + panorama_density(d_panorama, sky_place(lit.position, lit.side));
    vec3 light = scattered_part(m, c.l_surface, first) * scattered(of_lit, d_lit) * panorama_radiance(d_panorama)
        * (c.area / (scatter_density(m, c.l_surface) * c.area * of_sky + from_sky));
    return light != vec3(0.0) ? light * hit.transmission * ray_transmission(ray_origin(p), c.l, c.far) : light;
}

// The weight of light from the panorama along l at a point that a path found with density `arrival` and drew l there with
// `density`, where it might have been found by `relayed_sky`, too.
float unrelayed(PathPoint p, vec3 l, float arrival, float density)
{
    if (TRANSPORT != TRANSPORT_ALL || arrival < 0.0 || !has_relays())
        return 1.0;
    float found = arrival * density;
    return found / max(found + relay_density(p.position, l, dot(p.side, l)), TINY);
}

// What arrives of light along l; `casts`: things block it where lamps and the sun alone cast shadows.
vec3 arriving(PathPoint p, vec3 l, float far, bool casts)
{
    bool is_traced = TRANSPORT == TRANSPORT_ALL || (casts && TRANSPORT == TRANSPORT_DIRECT);
    return is_traced ? ray_transmission(ray_origin(p), l, far) : vec3(1.0);
}

// What lamps add directly: every one at the first point, one of them at each later one. `arrival`: the density per area with which
// the path found this point, below 0 where `relayed_light` could not find it.
vec3 lamps_light(PathPoint p, Scatter m, bool first, float arrival, inout uvec4 seed)
{
    uint lamps = lamp_count(), rays = first ? lamps : min(lamps, 1u);
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < rays; ++i) {
        seed.w += 1u;
        uvec4 bits = pcg4d(seed);
        PointLight lamp = lights[first ? i : min(uint(unit_from_bits(bits.x) * float(lamps)), lamps - 1u)];
        if (lamp.radius > 0.0)
            lamp = lamp_point(lamp, p.position, units_from_bits(bits.yz));
        vec3 l;
        float far;
        vec3 light = lamp_light(p, m, lamp, l, far) * (first ? 1.0 : float(lamps));
        if (arrival >= 0.0)
            light *= arrival / max(arrival + lamp_density(dot(p.side, l), far), TINY);
        if (light != vec3(0.0))
            sum += light * arriving(p, l, far, true);
    }
    return sum;
}

// What the panorama adds directly, by one sample of it.
vec3 sky_light(PathPoint p, Scatter m, mat3 world_from_surface, uint place, bool first, float arrival, uvec4 bits)
{
    vec3 l;
    float density;
    vec3 light = panorama_light(m, world_from_surface, place, bits, first, l, density);
    light *= ambient_share(p, l) * unrelayed(p, l, arrival, density);
    return light != vec3(0.0) ? light * arriving(p, l, 1e30, sun_density(l) > 0.0) : light;
}

// What a surface that shines adds, by one of its points.
vec3 emitted_light(PathPoint p, Scatter m, mat3 world_from_surface, bool first, uvec4 bits)
{
    EmitterLight light;
    if (!emitter_light(p, units_from_bits(bits.xy), light))
        return vec3(0.0);
    vec3 l_surface = light.l * world_from_surface;
    float density = scatter_density(m, l_surface) * light.area + light.density;
    return scattered_part(m, l_surface, first) * light.radiance * (light.area / max(density, TINY));
}

// At a sheet that light diffuses through a path goes on from one of its sides, each half of the time. From the other side no relay
// was followed to it.
void choose_side(inout PathPoint p, inout vec3 throughput, inout float arrival, inout uvec4 seed)
{
    seed.w += 1u;
    throughput *= 2.0;
    if (unit_from_bits(pcg4d(seed).x) < 0.5)
        return;
    Scatter m = make_scatter(p.s, surface_basis(p.s));
    float left = left_by_dielectric(m.energy, m.at_v);
    left *= (rays_have(RAYS_CLEARCOAT) ? m.coat.left : 1.0) * (rays_have(RAYS_SHEEN) ? m.left_by_sheen : 1.0);
    p.s = other_side(p.s, left);
    p.side = -p.side;
    arrival = -1.0;
}

// `seed.w` counts the path's random numbers.
vec3 transported_light(PathPoint p, uvec4 seed)
{
    vec3 sum = vec3(0.0), throughput = vec3(1.0);
    bool has_lamps = lamp_count() > 0u;
    float arrival = -1.0, drawn = 0.0; // `drawn`: density with which `emitted_light` finds this point
    for (uint bounce = 0u; bounce < MOST_BOUNCES; ++bounce) {
        bool first = bounce == 0u;
        if (p.s.emission != vec3(0.0) && (!first || is_shown(true)))
            sum += throughput * p.s.emission * (arrival < 0.0 ? 1.0 : arrival / max(arrival + drawn, TINY));
        if (rays_have(RAYS_DIFFUSE_TRANSMISSION) && p.s.diffuse_transmission != vec3(0.0))
            choose_side(p, throughput, arrival, seed);
        mat3 world_from_surface = surface_basis(p.s);
        Scatter m = make_scatter(p.s, world_from_surface);
        uint place = TRANSPORT == TRANSPORT_ALL ? sky_place(p.position, p.side) : 0u;
        if (has_lamps && !(first && !is_shown(true)))
            sum += throughput * lamps_light(p, m, first, arrival, seed);
        seed.w += 1u;
        sum += throughput * sky_light(p, m, world_from_surface, place, first, arrival, pcg4d(seed));
        seed.w += 1u;
        if (TRANSPORT == TRANSPORT_ALL && has_lamps && !(first && !is_shown(false)))
            sum += throughput * relayed_light(p, m, world_from_surface, first, pcg4d(seed));
        seed.w += 1u;
        if (TRANSPORT == TRANSPORT_ALL && has_relays() && !(first && !is_shown(false)))
            sum += throughput * relayed_sky(p, m, world_from_surface, first, pcg4d(seed));
        seed.w += 1u;
        if (TRANSPORT == TRANSPORT_ALL && has_emitters() && !(first && !is_shown(false))) {
            sum += throughput * emitted_light(p, m, world_from_surface, first, pcg4d(seed));
            seed.w += 1u;
        }
        uvec4 bits = pcg4d(seed);
        bool mirrored;
        vec3 l = sample_scatter(m, bits, mirrored);
        if (l.z <= 0.0 || (first && mirrored && PART == PART_SOFT_DIFFUSE))
            break;
        float density = scatter_density(m, l);
        throughput *= mirrored ? mirrored_weight(m) : scattered_part(m, l, first) / density;
        vec3 l_world = world_from_surface * l;
        RayHit hit = RayHit(-1.0, 0u, vec3(0.0), vec3(1.0));
        bool at_sun = TRANSPORT == TRANSPORT_DIRECT && sun_density(l_world) > 0.0;
        if (at_sun)
            throughput *= ray_transmission(ray_origin(p), l_world, 1e30);
        if (throughput == vec3(0.0))
            break;
        if (TRANSPORT == TRANSPORT_ALL)
            hit = trace_seen(ray_origin(p), l_world, mirrored);
        throughput *= hit.transmission;
        if (first && !is_shown(hit.t < 0.0 && sun_density(l_world) > 0.0))
            break;
        if (hit.t < 0.0) {
            vec3 l_panorama = panorama_from_world(l_world);
            float both = density + panorama_density(l_panorama, place), share = mirrored ? 1.0 : density / both;
            share *= mirrored ? 1.0 : unrelayed(p, l_world, arrival, both);
            sum += throughput * panorama_radiance(l_panorama) * (share * ambient_share(p, l_world));
            break;
        }
        if (bounce + 1u >= CERTAIN_BOUNCES) {
            float survival = min(max(throughput.r, max(throughput.g, throughput.b)), MOST_SURVIVAL);
            if (unit_from_bits(bits.w) >= survival)
                break;
            throughput /= survival;
        }
        p = ray_point(hit, l_world);
        arrival = mirrored ? -1.0 : density * dot(p.side, p.s.v) / max(hit.t * hit.t, TINY);
        drawn = emitter_density(hit.triangle);
        if (mirrored && !look_into_hit(p, hit, l_world, throughput, seed)) {
            sum += throughput;
            break;
        }
    }
    return sum;
}

#endif
