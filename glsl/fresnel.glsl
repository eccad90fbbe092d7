// What a smooth surface reflects, by the cosine to its normal; twins of src/reference/brdf.rs and src/reference/film.rs; no bindings.
#ifndef PBR_VR_FRESNEL
#define PBR_VR_FRESNEL

#include "math.glsl"

// A thin film over a part of a surface.
struct Film {
    float share;     // of the surface; 0 without a film
    float ior;       // index of refraction
    float thickness; // nanometres
    vec3 base_f0;    // of what is below it
};

const Film NO_FILM = Film(0.0, 1.0, 0.0, vec3(0.0));

// What a surface reflects seen head on, and at grazing angles; the latter is 1 but for KHR_materials_specular. With a film these are
// what has the same mean over all directions.
struct Fresnel {
    vec3 f0;
    float f90;
    Film film;
};

// Without a film.
Fresnel bare_fresnel(vec3 f0, float f90)
{
    return Fresnel(f0, f90, NO_FILM);
}

// (1 - cosine)^5, multiplied out: pow() of a base that rounding made negative is NaN.
float schlick_weight(float cosine)
{
    float x = 1.0 - clamp(cosine, 0.0, 1.0);
    float x2 = x * x;
    return x2 * x2 * x;
}

// Schlick, "An Inexpensive BRDF Model for Physically-based Rendering" (1994), eq. 15. It knows of no film.
vec3 f_schlick(Fresnel f, float vh)
{
    return f.f0 + (f.f90 - f.f0) * schlick_weight(vh);
}

// Constants of the film: see src/reference/film.rs.
const int FILM_ORDERS = 2;
const float FILM_THIN = 0.03;
const vec3 EYE_HEIGHTS = vec3(5.4856e-13, 4.4201e-13, 5.2481e-13);
const vec3 EYE_CENTRES = vec3(1.6810e6, 1.7953e6, 2.2084e6);
const vec3 EYE_VARIANCES = vec3(4.3278e9, 9.3046e9, 6.6121e9);
const float EYE_WHITE = 1.0685e-7;

// What interference of a path difference in metres is to an eye, linear RGB; `shift`: phases of reflection.
vec3 film_sensitivity(float path, vec3 shift)
{
    const mat3 RGB_FROM_XYZ = mat3(3.2404542, -0.969266, 0.0556434,
                                   -1.5371385, 1.8760108, -0.2040259,
                                   -0.4985314, 0.0415560, 1.0572252);
    float phase = 2.0 * PI * path, phase2 = phase * phase;
    vec3 xyz = EYE_HEIGHTS * sqrt(2.0 * PI * EYE_VARIANCES) * cos(EYE_CENTRES * phase + shift) * exp(-EYE_VARIANCES * phase2);
    xyz.x += 9.7470e-14 * sqrt(2.0 * PI * 4.5282e9) * cos(2.2399e6 * phase + shift.x) * exp(-4.5282e9 * phase2);
    return RGB_FROM_XYZ * (xyz / EYE_WHITE);
}

// Reflectance where the film is. Belcour and Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying
// Iridescence" (2017), as glTF's KHR_materials_iridescence has it.
vec3 film_reflectance(Film film, float cosine)
{
    cosine = clamp(cosine, 0.0, 1.0);
    float ior = mix(1.0, film.ior, smoothstep(0.0, FILM_THIN, film.thickness));
    float inside2 = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    if (inside2 <= 0.0)
        return vec3(1.0);
    float inside = sqrt(inside2), top = (ior - 1.0) / (ior + 1.0);
    float r12 = mix(top * top, 1.0, schlick_weight(cosine));
    vec3 root = sqrt(clamp(film.base_f0, vec3(0.0), vec3(0.9999)));
    vec3 base = (1.0 + root) / (1.0 - root), bottom = (base - ior) / (base + ior);
    vec3 r23 = mix(bottom * bottom, vec3(1.0), schlick_weight(inside));
    vec3 shift = (ior < 1.0 ? 0.0 : PI) + PI * vec3(lessThan(base, vec3(ior)));
    float path = 2e-9 * ior * film.thickness * inside;
    vec3 both = clamp(r12 * r23, vec3(1e-5), vec3(0.9999)), each = sqrt(both);
    vec3 below = (1.0 - r12) * (1.0 - r12) * r23 / (1.0 - both);
    vec3 sum = r12 + below, order = below - (1.0 - r12);
    for (int m = 1; m <= FILM_ORDERS; m++) {
        order *= each;
        sum += order * 2.0 * film_sensitivity(float(m) * path, float(m) * shift);
    }
    return clamp(sum, vec3(0.0), vec3(1.0));
}

// Reflectance at a cosine, with the film.
vec3 reflectance(Fresnel f, float cosine)
{
    vec3 bare = f_schlick(f, cosine);
    if (f.film.share <= 0.0)
        return bare;
    // f0 stands for the film as well.
    Fresnel below = Fresnel(f.film.base_f0, f.f90, f.film);
    return mix(f_schlick(below, cosine), film_reflectance(f.film, cosine), f.film.share);
}

// By Schlick's form what reflects as much at this cosine: for looking up albedos that are seen from there.
Fresnel seen_fresnel(Fresnel f, float cosine)
{
    if (f.film.share <= 0.0)
        return f;
    float grazing = schlick_weight(cosine);
    vec3 f0 = (reflectance(f, cosine) - grazing) / max(1.0 - grazing, TINY);
    return bare_fresnel(clamp(f0, vec3(0.0), vec3(1.0)), 1.0);
}

// A dielectric's reflectance, or a metal's, whose base color it is. Karis (2013), section "Material Model".
Fresnel fresnel_from_metallic(vec3 base_color, float metallic, Fresnel dielectric)
{
    Film film = dielectric.film;
    film.base_f0 = mix(film.base_f0, base_color, metallic);
    return Fresnel(mix(dielectric.f0, base_color, metallic), mix(dielectric.f90, 1.0, metallic), film);
}

#endif
