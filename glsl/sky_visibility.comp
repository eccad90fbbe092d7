// Finds out what of the panorama is seen from where: rays towards its tiles from points of paths that begin at the eyes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lamp.glsl"
#include "ray_surface.glsl"
#include "sky_relay.glsl"

layout(local_size_x = 64) in;

layout(SKY_TRIED, scalar) buffer Tries { Tried tries[]; };
layout(SKY_COMES, scalar) buffer Comes { uint comes[]; }; // of each tile and cell: see sky_relay.glsl
// For each workgroup, of points that paths find second or later: irradiance of the sky as far as following it is the better way
// to find it, and of everything that shines.
layout(SKY_SHARES, scalar) buffer Shares { vec2 shares[]; };
layout(push_constant, scalar) uniform Work {
    uint paths;
};

const uint POINTS = 6; // of a path

shared vec2 found[64];

// A vertex of a path, from which rays are tried.
struct PathVertex {
    PathPoint p;
    vec3 origin;
    uint place;    // 0 for none
    float arrival; // density per area with which paths that scatter evenly find it, below 0 at the first
};

// Counts a ray along l, `seen` if nothing blocked it: for its tile, and for where its light comes in. Returns what it adds to both
// `shares` as a sample of this density, 1/sr.
vec2 tried(PathVertex from, vec3 l, float density, bool seen)
{
    if (from.place == 0u)
        return vec2(0.0);
    vec3 l_panorama = panorama_from_world(l);
    float cosine = dot(from.p.side, l);
    uint tile = tile_of(sky_cell(l_panorama)), i = from.place * TILES + tile;
    atomicAdd(tries[i].rays, 1u);
    if (!seen)
        return vec2(0.0);
    atomicAdd(tries[i].seen, uint(SEEN_STEPS * cosine * cosine + 0.5));
    atomicAdd(comes[tile * RELAY_CELLS + relay_cell(from.origin, l)], uint(SEEN_STEPS * cosine + 0.5));
    if (from.arrival < 0.0)
        return vec2(0.0);
    float irradiance = dot(panorama_radiance(l_panorama), vec3(1.0)) * cosine / density;
    float relayed = relay_density(from.origin, l, cosine);
    return irradiance * vec2(relayed / max(relayed + from.arrival * density, TINY), 1.0);
}

// Irradiance of all lamps, estimated by one of them.
float lamp_share(PathVertex from, uint bits)
{
    uint lamp = min(uint(unit_from_bits(bits) * float(lamp_count())), lamp_count() - 1u);
    vec3 l, irradiance = light_irradiance(lights[lamp], from.p.position, l);
    float cosine = dot(from.p.side, l), far = distance(lights[lamp].position, from.p.position);
    if (cosine <= 0.0 || trace_ray(from.origin, l, far, true).t >= 0.0)
        return 0.0;
    return dot(irradiance, vec3(1.0)) * cosine * float(lamp_count());
}

// A ray of an eye, through a random place of its picture.
vec3 eye_ray(uvec4 bits, out vec3 origin)
{
    uint eye = bits.z % EYES;
    vec4 t = frame.eyes[eye].tangents;
    vec2 u = units_from_bits(bits.xy);
    origin = frame.eyes[eye].world_from_view[3].xyz;
    return normalize(mat3(frame.eyes[eye].world_from_view) * vec3(mix(t.x, t.y, u.x), mix(t.z, t.w, u.y), -1.0));
}

// Follows a path; returns the sum of both `shares` at its points.
vec2 learned(uint path)
{
    vec2 sum = vec2(0.0);
    vec3 origin, d = eye_ray(pcg4d(uvec4(path, frame.sample_index, 0u, 7u)), origin);
    RayHit hit = trace_ray(origin, d, 1e30, false);
    float density = -1.0; // of d
    for (uint point = 0u; point < POINTS && hit.t >= 0.0; ++point) {
        PathVertex from;
        from.p = ray_point(hit, d);
        from.origin = ray_origin(from.p);
        from.place = sky_place(from.p.position, from.p.side);
        from.arrival = density * dot(from.p.side, from.p.s.v) / max(hit.t * hit.t, TINY);
        uvec4 bits = pcg4d(uvec4(path, frame.sample_index, point, 8u)), more = pcg4d(bits);
        vec3 l = world_from_panorama(sample_panorama(bits, from.place));
        float cosine = dot(from.p.side, l);
        float both = panorama_density(panorama_from_world(l), from.place) + max(cosine, 0.0) * INV_PI;
        sum += tried(from, l, both, cosine > 0.0 && trace_ray(from.origin, l, 1e30, true).t < 0.0);
        if (from.arrival >= 0.0 && lamp_count() > 0u)
            sum.y += lamp_share(from, more.z);
        d = basis(from.p.side) * cosine_direction(units_from_bits(more.xy));
        density = dot(from.p.side, d) * INV_PI;
        hit = trace_ray(from.origin, d, 1e30, false);
        sum += tried(from, d, density + panorama_density(panorama_from_world(d), from.place), hit.t < 0.0);
        if (from.arrival >= 0.0 && hit.t >= 0.0)
            sum.y += PI * dot(emission_of_hit(hit), vec3(1.0));
    }
    return sum;
}

void main()
{
    uint path = gl_GlobalInvocationID.x;
    found[gl_LocalInvocationIndex] = path < paths ? learned(path) : vec2(0.0);
    barrier();
    if (gl_LocalInvocationIndex != 0u)
        return;
    for (uint i = 1u; i < 64u; ++i)
        found[0] += found[i];
    shares[gl_WorkGroupID.x] += found[0];
}
