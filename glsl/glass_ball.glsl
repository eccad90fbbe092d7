// What pictures show through a solid ball of glass: its surroundings, as probes and the panorama have them, upside down.
#ifndef GLASS_BALL_GLSL
#define GLASS_BALL_GLSL

#include "environment.glsl"
#include "instance.glsl"
#include "refraction.glsl"
#include "surface.glsl"

// The radius of the ball: its normals are its corners over it, and interpolated as these.
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

// The lobe of light that goes through a ball; `width2`: of a pixel in radii, squared. Images are small, most of all at the rim: as
// large a part of one is averaged as the pixel shows.
SpecularLobe through_lobe(Surface s, float ior, vec3 l, float width2)
{
    float variance = width2 * ball_spread2(s.nv, ior) / 12.0;
    float mirrored = specular_lobe(s.n, s.n, 1.0, bare_fresnel(vec3(1.0), 1.0), s.roughness, 0.0).spread;
    SpecularLobe lobe;
    lobe.reflectance = vec3(1.0);
    lobe.even = 0.0;
    lobe.towards = l;
    lobe.apart = vec3(0.0);
    lobe.spread = 1.0 - (1.0 - ball_variance(ior) * mirrored) / (1.0 + 0.5 * variance);
    lobe.level = level_from_spread(lobe.spread);
    lobe.entry = lobe.mean_entry = vec2(0.0);
    return lobe;
}

// Of all around a ball; `position`: where the light leaves it, seen from the eye.
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

// What the fragment of a ball sends to the eye; `light`: of its surface where that covers what is behind. The surface then covers
// all: nothing that was drawn before is seen through it.
vec3 with_what_is_seen_through(inout Surface s, vec3 light)
{
    Material material = materials[instances[draw.instance].material];
    BallPath path = ball_path(s.n, s.v, material.ior);
    float radius = ball_radius(), far = path.chord * radius;
    SpecularLobe lobe = through_lobe(s, material.ior, path.l, pixel_width2(s.v) / max(radius * radius, TINY));
    vec3 seen = surroundings(lobe, position_world + far * path.inside);
    vec3 through = s.transmission * s.transmission * exp(-material.absorption * far) * seen;
    vec3 sum = mix(through, light, s.alpha);
    s.alpha = gl_FrontFacing ? 1.0 : 0.0; // the back is seen through the front
    s.transmission = vec3(1.0);
    return sum;
}

#endif
