// The BRDF's terms, one function each, twins of src/reference/brdf.rs; no bindings.
// n, v, l: unit vectors away from the surface (normal, to the eye, to the light); h = v + l of any length.
#ifndef PBR_VR_BRDF
#define PBR_VR_BRDF

#include "fresnel.glsl"
#include "math.glsl"

// Values of `geometry` below, the two sets of terms; a stage file may feed them from a specialisation constant.
// SMITH: height-correlated masking and a diffuse part that keeps the energy. KARIS2013: the thesis's terms, but Fresnel's once.
const int GEOMETRY_SMITH = 0;
const int GEOMETRY_KARIS2013 = 1;

// Roughness below which a light of no size is not sharpened further: there D falls to a quarter over 4 alpha = 0.46
// degrees, less than the sun's disc (0.53 degrees) and about five pixels of an HTC Vive (0.09 degrees); a smaller
// highlight belongs to no real light source and flickers between pixels.
const float MIN_ROUGHNESS = 0.045;

// alpha = roughness^2: Burley, "Physically-Based Shading at Disney" (2012), section 5.4.
float alpha_from_roughness(float roughness)
{
    float r = max(roughness, MIN_ROUGHNESS);
    return r * r;
}

const float MOST_WIDENED = 0.18;

// Alpha whose lobe, seen once, is as wide as that of a pixel's normals all together, whose variance is given: alpha^2
// grows by it, up to a bound. Tokuyoshi and Kaplanyan, "Improved Geometric Specular Antialiasing" (2019).
float widened_alpha(float alpha, float variance)
{
    return sqrt(min(alpha * alpha + min(variance, MOST_WIDENED), 1.0));
}

vec2 widened_alphas(vec2 alphas, float variance)
{
    return vec2(widened_alpha(alphas.x, variance), widened_alpha(alphas.y, variance));
}

float widened_roughness(float roughness, float variance)
{
    return sqrt(widened_alpha(alpha_from_roughness(roughness), variance));
}

// GGX: Walter et al., "Microfacet Models for Refraction through Rough Surfaces" (2007), eq. 33.
// 1 - (n.h)^2 is written |n x h|^2, which keeps its digits near the lobe's centre, and both are scaled by |h|^2
// instead of normalising h. Finite for every alpha >= 0, also for h = 0 (l = -v), where it is 0.
float d_ggx(vec3 n, vec3 h, float alpha)
{
    vec3 sine = cross(n, h);
    float cosine = alpha * dot(n, h);
    float k = alpha * dot(h, h) / max(dot(sine, sine) + cosine * cosine, TINY);
    return k * k * INV_PI;
}

// Alphas along the direction in which highlights are stretched, and across it, for a strength from 0 to 1:
// KHR_materials_anisotropy.
vec2 stretched_alphas(float alpha, float strength)
{
    return vec2(mix(alpha, 1.0, strength * strength), alpha);
}

// GGX over an ellipse of slopes: Burley (2012), appendix B.2; h of any length in a frame whose x is the direction of alphas.x and
// whose z is the normal. Finite for all alphas >= 0, as d_ggx.
float d_ggx_stretched(vec3 h, vec2 alphas)
{
    float ratio = max(alphas.x, TINY) / max(alphas.y, TINY), product = alphas.x * alphas.y;
    float k = sqrt(product) * dot(h, h) / max(h.x * h.x / ratio + h.y * h.y * ratio + product * h.z * h.z, TINY);
    return k * k * INV_PI;
}

// v_smith_height_correlated for it, in the same frame: Heitz (2014), eq. 86.
float v_smith_stretched(vec3 l, vec3 v, vec2 alphas)
{
    float towards_v = max(l.z, MIN_COS) * length(vec3(alphas * v.xy, max(v.z, MIN_COS)));
    float towards_l = max(v.z, MIN_COS) * length(vec3(alphas * l.xy, max(l.z, MIN_COS)));
    return 0.5 / (towards_v + towards_l);
}

// Height-correlated Smith masking and shadowing over 4 nl nv: Heitz, "Understanding the Masking-Shadowing Function"
// (2014), eq. 99, with Lambda of GGX, eq. 72. Both cosines are cancelled, so nothing vanishes at grazing angles.
float v_smith_height_correlated(float nl, float nv, float alpha)
{
    nl = max(nl, MIN_COS);
    nv = max(nv, MIN_COS);
    float a2 = alpha * alpha;
    float towards_v = nl * sqrt(a2 + (1.0 - a2) * nv * nv);
    float towards_l = nv * sqrt(a2 + (1.0 - a2) * nl * nl);
    return 0.5 / (towards_v + towards_l);
}

// Schlick's G1(l) G1(v) over 4 nl nv for a given k: Karis, "Real Shading in Unreal Engine 4" (2013), eq. 4.
float v_karis2013(float nl, float nv, float k)
{
    nl = max(nl, MIN_COS);
    nv = max(nv, MIN_COS);
    return 0.25 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
}

// For point lights, k = (roughness + 1)^2 / 8: Karis (2013), eq. 4 and the remapping above it.
float v_karis2013_direct(float nl, float nv, float roughness)
{
    return v_karis2013(nl, nv, (roughness + 1.0) * (roughness + 1.0) * 0.125);
}

// For the environment, k = roughness^2 / 2: Karis (2013), section on the geometric term.
float v_karis2013_ibl(float nl, float nv, float roughness)
{
    return v_karis2013(nl, nv, roughness * roughness * 0.5);
}

// The visibility of `geometry` for a point light.
float v_direct(float nl, float nv, float roughness, int geometry)
{
    return geometry == GEOMETRY_KARIS2013 ? v_karis2013_direct(nl, nv, roughness)
                                          : v_smith_height_correlated(nl, nv, alpha_from_roughness(roughness));
}

// The visibility of `geometry` for light from all around. Any roughness from 0: the integrals need no floor.
float v_environment(float nl, float nv, float roughness, int geometry)
{
    return geometry == GEOMETRY_KARIS2013 ? v_karis2013_ibl(nl, nv, roughness)
                                          : v_smith_height_correlated(nl, nv, roughness * roughness);
}

// Schlick's weight towards max(1 - roughness, f0) instead of 1: Lagarde, "Adopting a physically based shading model"
// (2011). A split-sum table holds this effect already; on top of one it counts Fresnel twice.
vec3 f_schlick_roughness(vec3 f0, float nv, float roughness)
{
    return f0 + (max(vec3(1.0 - roughness), f0) - f0) * schlick_weight(nv);
}

// Coverage of a sheet that transmits light, at a cosine, from that of light from all sides: by Schlick's form it transmits
// 1 - F = (1 - F0) (1 - weight), whose mean under the cosine is (1 - F0) 20 / 21.
float slanted_coverage(float coverage, float cosine)
{
    return max(1.0 - (1.0 - coverage) * 1.05 * (1.0 - schlick_weight(cosine)), 0.0);
}

// Lambert's cosine law as a BRDF: albedo / pi.
vec3 diffuse_lambert(vec3 albedo)
{
    return albedo * INV_PI;
}

// The thesis's: Lambert times 1 - F(v.h), for light of no size. Reflects up to 1.86 times what it gets.
vec3 diffuse_karis2013(vec3 albedo, Fresnel f, float vh)
{
    return (1.0 - reflectance(f, vh)) * diffuse_lambert(albedo);
}

// Albedo of single scattering, F0 A + F90 B; `entry`: A and B.
vec3 single_albedo(Fresnel f, vec2 entry)
{
    return f.f0 * entry.x + f.f90 * entry.y;
}

// Single scattering for light of no size, in 1/sr; multiply by max(n.l, 0) and the light's irradiance.
// F V D: Cook and Torrance, "A Reflectance Model for Computer Graphics" (1982), with V = G / (4 nl nv).
// v.h = |v + l| / 2 for unit vectors, which needs neither a normalised h nor a guard at l = -v.
vec3 specular(vec3 n, vec3 v, vec3 l, Fresnel f, float roughness, int geometry)
{
    vec3 h = v + l;
    float d = d_ggx(n, h, alpha_from_roughness(roughness));
    return reflectance(f, 0.5 * length(h)) * (d * v_direct(dot(n, l), dot(n, v), roughness, geometry));
}

// Phong exponent whose lobe is as wide as Beckmann's of this roughness. 2 / alpha^2 - 2 is the exponent over n.h (Walter
// et al. 2007, section 5.2); the angle to the mirror direction is twice that to h, which takes a quarter of it.
float phong_exponent(float roughness)
{
    float alpha = alpha_from_roughness(roughness);
    return 0.5 / (alpha * alpha) - 0.5;
}

// Energy-normalised Phong lobe in 1/sr for a specular reflectance of 1: Lafortune and Willems, "Using the Modified Phong
// Reflectance Model for Physically Based Rendering" (1994), section 3.
float phong_lobe(vec3 n, vec3 v, vec3 l, float exponent)
{
    float rv = clamp(dot(reflect(-l, n), v), MIN_COS, 1.0);
    return (exponent + 2.0) * 0.5 * INV_PI * pow(rv, exponent);
}

// The same for light of no size.
float phong_specular(vec3 n, vec3 v, vec3 l, float roughness)
{
    return phong_lobe(n, v, l, phong_exponent(roughness));
}

#endif
