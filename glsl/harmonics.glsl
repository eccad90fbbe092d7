// Real spherical harmonics, and the clamped cosine in them; no bindings.
#ifndef PBR_VR_HARMONICS
#define PBR_VR_HARMONICS

#include "math.glsl"

// Real harmonic of degree l and order m in [-l, l] for unit d, polar axis z, without the Condon-Shortley sign: fully
// normalised, by Holmes and Featherstone, "A Unified Approach to the Clenshaw Summation and the Recursive Computation of
// Very High Degree and Order Normalised Associated Legendre Functions" (2002), eqs. 11 to 13; the factor sin^m of the
// polar angle is taken into (x + iy)^m, so that the poles need no care.
float harmonic(int l, int m, vec3 d)
{
    int order = abs(m);
    float p = sqrt(0.25 * INV_PI);
    vec2 turn = vec2(1.0, 0.0);
    for (int i = 1; i <= order; ++i) {
        p *= sqrt(float(2 * i + 1) / float(2 * i));
        turn = vec2(turn.x * d.x - turn.y * d.y, turn.x * d.y + turn.y * d.x);
    }
    float below = 0.0;
    for (int i = order + 1; i <= l; ++i) {
        float wide = sqrt(float(4 * i * i - 1) / float(i * i - order * order));
        float last = sqrt(float((i - 1) * (i - 1) - order * order) / float(4 * (i - 1) * (i - 1) - 1));
        float next = wide * (d.z * p - last * below);
        below = p;
        p = next;
    }
    return m == 0 ? p : sqrt(2.0) * p * (m > 0 ? turn.x : turn.y);
}

// What the clamped cosine over pi multiplies harmonics of degree l by: Ramamoorthi and Hanrahan, "An Efficient
// Representation for Irradiance Environment Maps" (2001), eq. 8, over pi; even degrees by the ratio of neighbours.
float cosine_lobe(int l)
{
    if (l < 2)
        return l == 0 ? 1.0 : 2.0 / 3.0;
    if ((l & 1) == 1)
        return 0.0;
    float a = 0.25;
    for (int i = 2; i < l; i += 2)
        a *= -float(i - 1) / float(i + 4);
    return a;
}

#endif
