// What pictures show through convex bodies of glass: their surroundings, as probes and the panorama have them. Of a ball light goes
// where a formula says, of others where src/scene/body_map.rs's map lets it out.
#ifndef GLASS_BODY_GLSL
#define GLASS_BODY_GLSL

#include "environment.glsl"
#include "instance.glsl"
#include "octahedral.glsl"
#include "refraction.glsl"
#include "surface.glsl"

// The radius of a ball: its normals are its corners over it, and interpolated as these.
float ball_radius()
{
    vec3 place_x = dFdx(position_world), place_y = dFdy(position_world), n_x = dFdx(normal_world), n_y = dFdy(normal_world);
    return sqrt((dot(place_x, place_x) + dot(place_y, place_y)) / max(dot(n_x, n_x) + dot(n_y, n_y), TINY));
}

// The pixel's width, squared, where the fragment is.
float pixel_width2(vec3 v)
{
    vec3 across = cross(dFdx(position_centre), v), down = cross(dFdy(position_centre), v);
    return 0.5 * (dot(across, across) + dot(down, down));
}

// The way of light from where it is seen.
struct BodyLight {
    vec3 position; // where it leaves the body
    vec3 l;        // along which it goes on
    float far;     // metres through the body
    float variance; // of l within the pixel
    float reflections; // inside
};

BodyLight light_of_ball(Surface s, float ior)
{
    BallPath path = ball_path(s.n, s.v, ior);
    float radius = ball_radius(), far = path.chord * radius;
    float variance = pixel_width2(s.v) / max(radius * radius, TINY) * ball_spread2(s.nv, ior) / 12.0;
    return BodyLight(position_world + far * path.inside, path.l, far, variance, 0.0);
}

// Normal and distance of a body's surface in a direction of any length from its centre.
vec4 body_surface(vec3 d)
{
    vec2 size = vec2(textureSize(extension_map, 0));
    vec2 at = ((0.5 * octahedral_encode(d) + 0.5) * (size - 1.0) + 0.5) / size;
    return textureLod(extension_map, at, 0.0);
}

// Where a ray from within a body leaves it, and the normal there; in radii, from the centre.
struct Exit {
    float t;
    vec3 n;
};

// Of a body of few faces, whose planes the map has.
Exit exit_by_faces(vec3 p, vec3 d)
{
    Exit e = Exit(1e30, d);
    int faces = textureSize(extension_map, 0).x;
    for (int i = 0; i < faces; ++i) {
        vec4 plane = texelFetch(extension_map, ivec2(i, 0), 0);
        float along = dot(plane.xyz, d), t = (plane.w - dot(plane.xyz, p)) / along;
        if (along > 0.0 && t < e.t)
            e = Exit(t, plane.xyz);
    }
    e.t = clamp(e.t, 0.0, 2.0);
    return e;
}

// How far a point is beyond the surface, seen from the centre.
float beyond_surface(vec3 p)
{
    return length(p) - body_surface(p).w;
}

// Of any convex body: a ray leaves it at one place, before it leaves the ball around it.
const uint BISECTIONS = 6;

Exit exit_by_distances(vec3 p, vec3 d)
{
    float along = dot(p, d), near = 0.0, far = sqrt(max(along * along - dot(p, p) + 1.0, 0.0)) - along;
    for (uint i = 0u; i < BISECTIONS; ++i) {
        float middle = 0.5 * (near + far);
        bool inside = beyond_surface(p + middle * d) < 0.0;
        near = inside ? middle : near;
        far = inside ? far : middle;
    }
    float before = -beyond_surface(p + near * d), after = beyond_surface(p + far * d);
    float t = mix(near, far, clamp(before / max(before + after, TINY), 0.0, 1.0));
    return Exit(t, normalize_or(body_surface(p + t * d).xyz, d));
}

// Total reflections that light is followed through; then it is taken to leave to anywhere around.
const uint MOST_REFLECTIONS = 6;

BodyLight light_of_convex_body(Surface s, Material material, float ior)
{
    mat4 world_from_local = frame.world_from_models * instances[draw.instance].world_from_local;
    float scale = length(world_from_local[0].xyz);
    mat3 turn = mat3(world_from_local) / scale;
    vec3 centre = (world_from_local * vec4(material.body_centre, 1.0)).xyz;
    float radius = scale * material.body_radius, far = 0.0;
    // At the pixel's centre: between triangles, places that are covered do not lie next to each other, nor do what follows from them.
    vec3 p = (position_centre - centre) * turn / radius, n = s.n * turn;
    vec3 v = normalize(frame.eyes[eye].world_from_view[3].xyz - position_centre);
    if (EXTENSION_MAP_OF == EXTENSION_BODY && !HAS_NORMAL_MAP)
        n = normalize_or(body_surface(p).xyz, n);
    vec3 d = refract(-v * turn, n, 1.0 / ior);
    bool leaves = false;
    float reflections = 0.0;
    for (uint i = 0u; i <= MOST_REFLECTIONS && !leaves; ++i) {
        Exit e;
        if (EXTENSION_MAP_OF == EXTENSION_FACES)
            e = exit_by_faces(p, d);
        else
            e = exit_by_distances(p, d);
        vec3 on = refract(d, -e.n, ior);
        bool reflected = on == vec3(0.0) && dot(d, e.n) > 0.0;
        p += e.t * d;
        far += e.t;
        d = reflected ? reflect(d, e.n) : on == vec3(0.0) ? d : on;
        leaves = !reflected;
        reflections += reflected ? 1.0 : 0.0;
    }
    vec3 l = turn * d;
    // Flat faces spread light no more than it is when it is seen.
    float variance = pixel_variance(EXTENSION_MAP_OF == EXTENSION_FACES ? v : l) + (leaves ? 0.0 : 1.0);
    return BodyLight(centre + turn * p * radius, l, far * radius, variance, reflections);
}

// The lobe of light that goes through a body. Images are small, most of all at a ball's rim: as large a part of one is averaged as the
// pixel shows. Roughness widens it as of a ball, and where it is mirrored inside as there.
SpecularLobe through_lobe(Surface s, float ior, BodyLight light)
{
    float mirrored = specular_lobe(s.n, s.n, 1.0, bare_fresnel(vec3(1.0), 1.0), s.roughness, 0.0).spread;
    SpecularLobe lobe;
    lobe.reflectance = vec3(1.0);
    lobe.even = 0.0;
    lobe.towards = light.l;
    lobe.apart = vec3(0.0);
    lobe.spread = 1.0 - max(1.0 - (ball_variance(ior) + light.reflections) * mirrored, 0.1) / (1.0 + 0.5 * light.variance);
    lobe.level = level_from_spread(lobe.spread);
    lobe.entry = lobe.mean_entry = vec2(0.0);
    return lobe;
}

// Of all around a body; `position`: where the light leaves it, seen from the eye.
vec3 surroundings(SpecularLobe lobe, vec3 position)
{
#ifdef LOCAL_PROBES
    float left;
    vec4 room = probes_image(lobe, position, left);
    return room.rgb + room.a * environment_image(lobe);
#else
    return environment_image(lobe);
#endif
}

// Cosines of the angle that light is bent by in all, between which what is seen through a body changes from its surroundings to what
// is drawn behind it: through a block's opposite faces, light goes on as it came. What a rough body shows is blurred, and so is the
// image of its surroundings.
const float BENT_COSINE = 0.99, STRAIGHT_COSINE = 0.9994;
const float CLEAR_ROUGHNESS = 0.1, FROSTED_ROUGHNESS = 0.25;

// What is seen through a body with this index of refraction; `straight`: the share of it that is drawn behind.
struct SeenThrough {
    vec3 transmission;
    vec3 radiance; // of the surroundings
    float straight;
};

SeenThrough seen_through(Surface s, Material material, float ior)
{
    BodyLight path;
    float straight = 0.0;
    if (EXTENSION_MAP_OF >= EXTENSION_BODY) {
        path = light_of_convex_body(s, material, ior);
        straight = smoothstep(BENT_COSINE, STRAIGHT_COSINE, -dot(path.l, s.v));
        straight *= 1.0 - smoothstep(CLEAR_ROUGHNESS, FROSTED_ROUGHNESS, s.roughness);
    } else
        path = light_of_ball(s, ior);
    vec3 transmission = s.transmission * s.transmission * exp(-material.absorption * path.far);
    return SeenThrough(transmission, surroundings(through_lobe(s, ior, path), path.position), straight);
}

// The same of a body that splits light: each colour by its own index.
SeenThrough seen_through_in_colours(Surface s, Material material)
{
    SeenThrough all = SeenThrough(vec3(0.0), vec3(0.0), 0.0);
    for (int i = 0; i < 3; ++i) {
        SeenThrough one = seen_through(s, material, material.ior + float(i - 1) * material.ior_spread);
        vec3 colour = vec3(i == 0, i == 1, i == 2);
        all.transmission += colour * one.transmission;
        all.radiance += colour * one.radiance;
        all.straight += one.straight / 3.0;
    }
    return all;
}

// What the fragment of a body sends to the eye; `light`: of its surface where that covers what is behind. As far as light is bent the
// surface then covers all: nothing that was drawn before is seen through it.
vec3 with_what_is_seen_through(inout Surface s, vec3 light)
{
    Material material = materials[instances[draw.instance].material];
    SeenThrough seen;
    if (DISPERSES)
        seen = seen_through_in_colours(s, material);
    else
        seen = seen_through(s, material, material.ior);
    // Without tints all colours go through alike.
    float straight = seen.straight * (TINTS ? 1.0 : luminance(seen.transmission));
    // As in a pane, both surfaces mirror what goes straight through them, any number of times.
    s.alpha = mix(s.alpha, 2.0 * s.alpha / (1.0 + s.alpha), seen.straight);
    vec3 sum = s.alpha * light + (1.0 - s.alpha) * (1.0 - straight) * seen.transmission * seen.radiance;
    // The back is seen through the front.
    s.alpha = gl_FrontFacing ? 1.0 - (1.0 - s.alpha) * straight : 0.0;
    s.transmission = TINTS ? seen.transmission : vec3(1.0);
    return sum / max(s.alpha, TINY);
}

#endif
