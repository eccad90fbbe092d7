// Surfaces that shine, as light for points that rays meet: they are drawn by their power.
// Shirley, Wang and Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations" (1996).
#ifndef EMITTERS_GLSL
#define EMITTERS_GLSL

#include "ray_surface.glsl"

struct Emitter {
    uint triangle;
    float cumulative; // share of all power up to this one's end
};

layout(RAY_EMITTERS, scalar) readonly buffer Emitters {
    uint emitter_count;
    float emitter_scale; // one over the sum of all triangles' areas times their materials' emission
    Emitter emitters[];
};

// Light of one point for another one.
struct EmitterLight {
    vec3 l;        // unit vector to it
    float far;     // metres
    float area;    // solid angle per area
    float density; // of such points per area
    vec3 radiance;
    float side;    // share of what leaves the point that leaves to this side
};

bool has_emitters()
{
    return rays_have(RAYS_EMITTERS) && emitter_count > 0u;
}

// Density per area with which points of a triangle are drawn.
float emitter_density(uint triangle)
{
    if (!rays_have(RAYS_EMITTERS))
        return 0.0;
    Material material = materials[bvh_material(triangle)];
    return emitter_scale * dot(material.emission, vec3(1.0));
}

// Whether a triangle's back is never seen.
bool is_one_sided(uint triangle)
{
    return (bvh_triangle(triangle).material_and_flags & BVH_ONE_SIDED) != 0u;
}

// Share of the light of a triangle's points that leaves to one side.
float emitted_to_side(uint triangle, bool back)
{
    return is_one_sided(triangle) ? (back ? 0.0 : 1.0) : 0.5;
}

// Whether light leaves a point with this emission: holes have none.
bool is_shining(RayHit hit, vec3 emission)
{
    vec3 through;
    return emission != vec3(0.0) && !(is_masked(hit.triangle) && is_hole(hit, 1.0, through));
}

// A point of all that shines.
RayHit sample_emitter(vec2 u)
{
    uint low = 0u, high = emitter_count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (u.x < emitters[middle].cumulative)
            high = middle;
        else
            low = middle + 1u;
    }
    float before = low > 0u ? emitters[low - 1u].cumulative : 0.0;
    float part = clamp((u.x - before) / max(emitters[low].cumulative - before, TINY), 0.0, 1.0), root = sqrt(part);
    return RayHit(0.0, emitters[low].triangle, vec3(1.0 - root, root * (1.0 - u.y), root * u.y), vec3(1.0));
}

// One point's light for p; false where none comes, or where something blocks it.
bool emitter_light(PathPoint p, vec2 u, out EmitterLight light)
{
    RayHit hit = sample_emitter(u);
    BvhTriangle triangle = bvh_triangle(hit.triangle);
    vec3 place = hit.weights.x * triangle.a + hit.weights.y * triangle.b + hit.weights.z * triangle.c;
    vec3 to = (frame.world_from_models * vec4(place, 1.0)).xyz - p.position;
    hit.t = light.far = length(to);
    light.l = to / max(hit.t, TINY);
    PathPoint there = ray_point(hit, light.l);
    float cosine = -dot(there.side, light.l), rounding = p.rounding + there.rounding;
    light.area = cosine / max(hit.t * hit.t, TINY);
    light.density = emitter_density(hit.triangle);
    light.radiance = there.s.emission;
    light.side = emitted_to_side(hit.triangle, is_back(hit, light.l));
    // Points of one plane do not light each other, whatever rounding makes of them.
    if (dot(p.s.n, light.l) <= 0.0 || dot(p.side, to) <= rounding || cosine * hit.t <= rounding)
        return false;
    if (!is_shining(hit, light.radiance))
        return false;
    light.radiance *= ray_transmission(ray_origin(p), light.l, hit.t - 2.0 * rounding);
    return light.radiance != vec3(0.0);
}

#endif
