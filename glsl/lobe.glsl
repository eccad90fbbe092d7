// The lobe that specular levels are averaged with, in closed form; twin of src/reference/lobe.rs; no bindings.
#ifndef PBR_VR_LOBE
#define PBR_VR_LOBE

// A lobe's constants: alpha^2, k = (1 - alpha^2) / 2.
struct Lobe {
    float alpha2;
    float k;
};

// Mean of K over a small part of the sphere, K(c) = c / q^2 with q = alpha^2 + k (1 - c), as weights of the light's integral
// (x) and of the integral of light times cosine (y), so that each colour has a mean cosine of its own.
//
// c is the mean cosine of all colours, `spread` a quarter of the variance 1 - m^2 of the directions around a mean vector of
// length m. To second order E[K] = K(c) + (E[cosine] - c) K'(c) + Var(c)/2 K''(c); half of the variance lies along the
// meridian towards the lobe's centre, where dc = sin, so Var(c) = (1 - m^2) (1 - c^2) / 2.
// K' = 1 / q^2 + 2 k c / q^3, K'' = 4 k / q^3 + 6 k^2 c / q^4.
vec2 lobe_mean(Lobe lobe, float c, float spread)
{
    float over_q = 1.0 / (lobe.alpha2 + lobe.k * (1.0 - c));
    float u = lobe.k * over_q;
    float slope = 1.0 + 2.0 * u * c;
    float bend = spread * (1.0 - c * c) * u * (4.0 + 6.0 * u * c);
    return c > 0.0 ? over_q * over_q * vec2(c + bend - c * slope, slope) : vec2(0.0);
}

// The same mean of G(c) = c (1 - c)^5, Schlick's Fresnel term under the cosine, for light of one colour, whose mean cosine is c.
// G'' = (1 - c)^3 (30 c - 10).
float grazing_mean(float c, float spread)
{
    float left = 1.0 - c, cubed = left * left * left;
    return c > 0.0 ? cubed * (c * left * left + spread * (1.0 - c * c) * (30.0 * c - 10.0)) : 0.0;
}

#endif
