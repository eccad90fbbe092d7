// A light that is a disc far away; twins of src/reference/disc.rs, which derives them; no bindings.
// n, v, l: unit vectors away from the surface (normal, to the eye, to the disc's centre). `sine`: of the disc's angular
// radius a. A disc of irradiance E, facing it, has the radiance E / (pi sine^2) and fills 2 pi (1 - cos a).
#ifndef PBR_VR_DISC
#define PBR_VR_DISC

#include "brdf.glsl"
#include "sampling.glsl"

// Smallest alpha for a disc: its lobe (0.05 degrees) is narrower than a headset's pixel, so that a mirror shows the disc and
// not a blur, and wide enough for f32.
const float DISC_MIN_ALPHA = 4e-4;

// Smallest n.h: beyond, slopes run away, and a disc would fill all of them. It changes D by at most 0.5 %.
const float LEAST_NH = 0.05;

// 1 - cos a.
float disc_versine(float sine)
{
    return sine * sine / (1.0 + sqrt(max(1.0 - sine * sine, 0.0)));
}

// Mean of max(n.l, 0) over the disc: n.l where all of it is above the horizon, below a parabola with the same value and slope
// at both ends.
float disc_cosine(float nl, float sine)
{
    float above = max(nl + sine, 0.0);
    return nl >= sine ? nl : above * above / (4.0 * sine);
}

// Mean of GGX over the disc's half vectors: over slopes, GGX is the stereographic projection of an even sphere, so that its
// integral over a circle is a spherical cap's area. The half vectors' ellipse is taken for a circle of the same area; as far as
// it is wider than the lobe, the distance is measured in its own radii.
float disc_ggx(vec3 n, vec3 v, vec3 l, float alpha, float sine)
{
    vec3 sum = v + l;
    float vh = max(0.5 * length(sum), MIN_COS);
    vec3 h = sum / (2.0 * vh);
    float nh = max(dot(n, h), LEAST_NH);
    // All squares of slopes are times nh^2 from here on.
    float a2 = alpha * nh * alpha * nh;
    float radius2 = 0.5 * disc_versine(sine) / (vh * nh);
    vec3 across = cross(v, l), off = cross(n, h);
    float aside = dot(n, across) * dot(n, across) / max(dot(across, across), TINY);
    float round = dot(off, off);
    float own_radii = max(round - aside, 0.0) / vh + aside * vh;
    float wider = radius2 / (radius2 + a2);
    float t2 = round + (own_radii - round) * wider * wider;
    float a = a2 + t2 - radius2, b2 = 4.0 * a2 * radius2;
    float hypotenuse = max(sqrt(a * a + b2), TINY);
    // H + A cancels for A < 0: (H + A) (H - A) = 4 alpha^2 rho^2.
    float mean = a >= 0.0 ? 2.0 * alpha * alpha / (hypotenuse + a) : (hypotenuse - a) / (2.0 * radius2 * nh * nh);
    // At most D's peak, also where h has no direction (l = -v).
    return min(mean / hypotenuse, 1.0 / (alpha * alpha)) * INV_PI;
}

// Single scattering of the disc's light in 1/sr; multiply by `disc_cosine` and the irradiance. Fresnel and masking are those
// of its centre, and masking's roughness is `geometry`'s for point lights.
vec3 disc_specular(vec3 n, vec3 v, vec3 l, Fresnel f, float alpha, float sine, int geometry)
{
    alpha = max(alpha, DISC_MIN_ALPHA);
    float nl = disc_cosine(dot(n, l), sine);
    l += (nl - dot(n, l)) * n; // what is above the horizon
    float visibility = geometry == GEOMETRY_KARIS2013 ? v_karis2013_direct(nl, dot(n, v), sqrt(alpha))
                                                      : v_smith_height_correlated(nl, dot(n, v), alpha);
    return reflectance(f, 0.5 * length(v + l)) * (disc_ggx(n, v, l, alpha, sine) * visibility);
}

// Phong exponent of a lobe that is widened by the disc: variances, 1 / exponent and sine^2 / 4 along each axis, add up.
float disc_phong_exponent(float exponent, float sine)
{
    return 1.0 / (1.0 / max(exponent, TINY) + 0.25 * sine * sine);
}

// A direction within the disc, evenly over its solid angle, for u in [0, 1)^2.
vec3 sample_disc(vec2 u, vec3 towards, float sine)
{
    float versine = u.x * disc_versine(sine);
    float across = sqrt(max(versine * (2.0 - versine), 0.0));
    float phi = 2.0 * PI * u.y;
    return basis(towards) * vec3(across * cos(phi), across * sin(phi), 1.0 - versine);
}

// Density of `sample_disc` at a unit direction, 1/sr; 0 outside of the disc. |d - towards|^2 is 2 (1 - cos), without its
// cancellation.
float disc_density(vec3 d, vec3 towards, float sine)
{
    float versine = disc_versine(sine);
    vec3 off = d - towards;
    return 0.5 * dot(off, off) <= versine ? 0.5 * INV_PI / versine : 0.0;
}

// The part of a disc's radiance that a pixel sees at an angle from its centre, both in radians, as is the pixel's width. The
// picture's sum of light stays the disc's, however small it is.
float disc_coverage(float angle, float radius, float pixel)
{
    float wide = max(radius, 0.5 * pixel);
    float ramp = clamp((wide - angle) / max(pixel, TINY) + 0.5, 0.0, 1.0);
    return ramp * radius * radius / (wide * wide + pixel * pixel / 12.0);
}

// The disc's radiance for an irradiance at normal incidence.
vec3 disc_radiance(vec3 irradiance, float sine)
{
    return irradiance * (INV_PI / (sine * sine));
}

#endif
