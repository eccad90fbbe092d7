// Sheen of cloth: light that fibres standing off a surface scatter, as a layer over it; twin of src/reference/sheen.rs; no bindings.
// Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF" (2017), as KHR_materials_sheen has it. What the layer does not
// scatter of light from all around is the base's: "albedo scaling", section 5 there.
#ifndef PBR_VR_SHEEN
#define PBR_VR_SHEEN

#include "shading_point.glsl"

// "Charlie": sin^(1 / alpha) of the half vector's angle to the normal, eq. 2; h of any length.
float d_charlie(vec3 n, vec3 h, float alpha)
{
    vec3 sine = cross(n, h);
    float squared = min(dot(sine, sine) / max(dot(h, h), TINY), 1.0);
    return (2.0 + 1.0 / alpha) * pow(squared, 0.5 / alpha) * 0.5 * INV_PI;
}

// L of eq. 3, with table 1's numbers.
float sheen_curve(float x, float alpha)
{
    float smoothness = (1.0 - alpha) * (1.0 - alpha);
    float a = mix(21.5473, 25.3245, smoothness), b = mix(3.82987, 3.32435, smoothness), c = mix(0.19823, 0.16801, smoothness);
    float d = mix(-1.97760, -1.27393, smoothness), e = mix(-4.32054, -4.85967, smoothness);
    return a / (1.0 + b * pow(x, c)) + d * x + e;
}

// Lambda of Smith's masking, eq. 3.
float sheen_lambda(float cosine, float alpha)
{
    cosine = clamp(cosine, MIN_COS, 1.0 - MIN_COS);
    return exp(cosine < 0.5 ? sheen_curve(cosine, alpha) : 2.0 * sheen_curve(0.5, alpha) - sheen_curve(1.0 - cosine, alpha));
}

// The layer's BRDF for a white sheen, 1/sr; Fresnel is 1.
float sheen_brdf(vec3 n, vec3 v, vec3 l, float roughness)
{
    float alpha = roughness * roughness, nl = max(dot(n, l), MIN_COS), nv = max(dot(n, v), MIN_COS);
    float visibility = 1.0 / ((1.0 + sheen_lambda(nv, alpha) + sheen_lambda(nl, alpha)) * 4.0 * nl * nv);
    return d_charlie(n, v + l, alpha) * visibility;
}

// The share of even light that a white sheen scatters, seen at this cosine: fitted to within 0.02 from n.v = 0.01 on.
float sheen_albedo(float nv, float roughness)
{
    const mat4 fit = mat4(1.163, -6.612, 10.185, -4.787, -15.96, 47.943, -60.737, 25.91,
        16.237, -52.29, 68.847, -30.245, -15.128, 45.438, -53.416, 21.619);
    vec4 of_roughness = vec4(1.0, roughness, roughness * roughness, roughness * roughness * roughness);
    vec4 of_cosine = vec4(1.0, nv, nv * nv, nv * nv * nv);
    return min(exp(dot(of_roughness * fit, of_cosine)), 1.0);
}

// Its mean under the cosine, to within 0.002.
float sheen_mean_albedo(float roughness)
{
    return 0.0314 + roughness * (-0.0752 + roughness * (0.8508 - 0.5066 * roughness));
}

// The share of its light that what is below keeps.
float under_sheen(vec3 sheen, float albedo)
{
    return 1.0 - max(sheen.r, max(sheen.g, sheen.b)) * albedo;
}

// The mean direction that the layer scatters light from: on the viewer's side, farther from the normal the smoother it
// is. Fitted to within 8 degrees.
vec3 sheen_towards(vec3 n, vec3 v, float nv, float roughness)
{
    return normalize(n + (v - nv * n) / ((0.55 + 6.4 * roughness * roughness) * (1.0 - 0.9 * nv)));
}

// What the surface below sends along v of light from l, with the layer over it; both 1/sr.
vec3 with_sheen(Surface s, vec3 l, vec3 below)
{
    return under_sheen(s.sheen, sheen_albedo(s.nv, s.sheen_roughness)) * below
        + s.sheen * sheen_brdf(s.n, s.v, l, s.sheen_roughness);
}

#endif
