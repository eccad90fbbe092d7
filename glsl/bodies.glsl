// Follows paths through bodies that bend light. Only paths that no other way of sampling finds stop at them: those that the eye
// sees directly, in mirrors and through other bodies. All other light goes straight through their surfaces, as through sheets, so
// that lamps, the sun and the panorama are found behind them; caustics are left out.
#ifndef BODIES_GLSL
#define BODIES_GLSL

#include "importance.glsl"
#include "ray_surface.glsl"
#include "refraction.glsl"
#include "scatter.glsl"

// Each boundary beyond these is gone to by chance: total reflection keeps few paths within walls for very long.
const uint CERTAIN_BOUNDARIES = 6;
const float BOUNDARY_SURVIVAL = 0.8;
const uint MOST_BOUNDARIES = 64;

// The first hit of a ray that ends at bodies if `stops` is set.
RayHit trace_seen(vec3 o, vec3 d, bool stops)
{
    stops_at_bodies = stops;
    RayHit hit = trace_ray(o, d, 1e30, false);
    stops_at_bodies = false;
    return hit;
}

// The colours whose index of refraction a path has; `left`: what it has left of each. Where bodies split light, that is one of them.
struct LeftColour {
    bool is_one;
    uint channel;
};

LeftColour left_colour(vec3 left, float u)
{
    bvec3 there = greaterThan(left, vec3(0.0));
    bool is_one = int(there.r) + int(there.g) + int(there.b) == 1;
    return LeftColour(is_one, is_one ? (there.r ? 0u : there.g ? 1u : 2u) : min(uint(3.0 * u), 2u));
}

// From a point of a body, seen from `inside` of it or from outside, to the point that is seen there: of its surface, where it
// mirrors, or of what is behind or in it. Light is multiplied by `throughput`. False where that is nothing: then `throughput`
// has the panorama's light.
bool look_into_bodies(inout PathPoint p, uint material, bool inside, inout vec3 throughput, inout uvec4 seed)
{
    for (uint boundary = 0u; boundary < MOST_BOUNDARIES; ++boundary) {
        float ior = materials[material].ior, spread = materials[material].ior_spread, alpha = p.s.roughness * p.s.roughness;
        mat3 world_from_surface = basis(p.s.n);
        vec3 v = p.s.v * world_from_surface, h = vec3(0.0, 0.0, 1.0);
        v = normalize(vec3(v.xy, max(v.z, MIN_COS)));
        seed.w += 1u;
        uvec4 bits = pcg4d(seed);
        LeftColour colour = LeftColour(true, 1u);
        if (spread > 0.0) {
            colour = left_colour(throughput, unit_from_bits(pcg4d(uvec4(seed.xyz, ~seed.w)).x));
            ior += (float(colour.channel) - 1.0) * spread;
        }
        if (alpha >= MIRROR_ALPHA)
            h = sample_vndf(v, units_from_bits(bits.xy), vec2(alpha));
        Crossing c = cross_boundary(v, h, alpha, inside ? 1.0 / ior : ior, unit_from_bits(bits.z));
        if (spread > 0.0 && !colour.is_one)
            throughput *= 3.0 * vec3(equal(uvec3(colour.channel), uvec3(0, 1, 2)));
        if (!inside && !c.transmitted)
            return true; // what the surface mirrors is its own light
        throughput *= c.transmitted ? c.weight * p.s.transmission : vec3(c.weight);
        if (boundary >= CERTAIN_BOUNDARIES)
            throughput *= unit_from_bits(bits.w) < BOUNDARY_SURVIVAL ? 1.0 / BOUNDARY_SURVIVAL : 0.0;
        if (throughput == vec3(0.0))
            return false;
        vec3 d = world_from_surface * c.l;
        RayHit hit = trace_seen(p.position + (c.transmitted ? -2.0 : 2.0) * p.rounding * p.side, d, true);
        throughput *= hit.transmission;
        if (inside != c.transmitted && hit.t >= 0.0)
            throughput *= exp(-materials[material].absorption * hit.t);
        if (hit.t < 0.0) {
            throughput *= panorama_radiance(panorama_from_world(d));
            return false;
        }
        p = ray_point(hit, d);
        material = bvh_material(hit.triangle);
        if (!refracts(materials[material]))
            return true;
        inside = is_back(hit, d);
    }
    throughput = vec3(0.0);
    return false;
}

// The same from what a ray of unit direction d met, whatever it is.
bool look_into_hit(inout PathPoint p, RayHit hit, vec3 d, inout vec3 throughput, inout uvec4 seed)
{
    uint material = bvh_material(hit.triangle);
    return !refracts(materials[material]) || look_into_bodies(p, material, is_back(hit, d), throughput, seed);
}

#endif
