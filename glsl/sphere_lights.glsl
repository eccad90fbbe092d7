// What surfaces mirror of sphere lights, which the images of probes leave out.
#ifndef SPHERE_LIGHTS_GLSL
#define SPHERE_LIGHTS_GLSL

#include "anisotropy.glsl"
#include "placed_probes.glsl"
#include "shadows.glsl"
#include "surface.glsl"

// A sphere is seen under a disc of at most this sine: surfaces that touch it see half of all directions.
const float MOST_SPHERE_SINE = 0.9;

// What reaches a place of a sphere's light, with a sharp edge: a soft one hardly shows in a mirror image, and a frame took half
// as long again for it. All is in the models' space.
vec3 sphere_visibility(SphereLight light, vec3 p, vec3 n)
{
    vec3 q = p - light.position;
    ShadowPlace place = lamp_place(q, n, light.shadow_near, 0.0, float(textureSize(lamp_shadows, 0).x));
    vec3 lit = sharp_shadow(lamp_shadows, lamp_transmission, place, float(light.shadow_layer) + place.layer);
    return light.shadow_layer < 0 ? vec3(1.0) : dot(n, q) < 0.0 ? lit : vec3(0.0);
}

// Single scattering of their light, but for the share `even`, which comes with the irradiance. `variance`: of the normals within the
// pixel.
vec3 mirrored_spheres(Surface s, float even, float variance)
{
    vec3 sum = vec3(0.0);
    Fresnel f = fresnel_of(s);
    vec3 p = position_in_models(position_world), n = models_from_world(triangle_normal());
    for (uint i = 0u; i < SPHERE_LIGHTS; ++i) {
        SphereLight light = frame.sphere_lights[i];
        vec3 to = light.position - p;
        float radius2 = light.radius * light.radius, far2 = max(dot(to, to), radius2 / (MOST_SPHERE_SINE * MOST_SPHERE_SINE));
        vec3 l = mat3(frame.world_from_models) * normalize_or(to, vec3(0.0, 1.0, 0.0));
        float sine = sqrt(radius2 / far2), cosine = disc_cosine(dot(s.n, l), sine);
        if (cosine > 0.0)
            sum += light.intensity * sphere_visibility(light, p, n) * (cosine / far2) * light_disc_specular(s, l, f, variance, sine, GEOMETRY);
    }
    return (1.0 - even) * sum;
}

#endif
