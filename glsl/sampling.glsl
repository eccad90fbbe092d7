// Points, half vectors and their densities, twins of src/reference/sampling.rs; no bindings.
// Local space: +Z is the normal.
#ifndef PBR_VR_SAMPLING
#define PBR_VR_SAMPLING

#include "brdf.glsl"

// The upper 24 bits of a fraction in [0, 1) held as 32 bits: exact in f32 and never 1.
float unit_from_bits(uint bits)
{
    return float(bits >> 8) * (1.0 / 16777216.0);
}

// Base-2 radical inverse: van der Corput's sequence, by reversing the bits.
float radical_inverse(uint i)
{
    return unit_from_bits(bitfieldReverse(i));
}

// Point i of the 2^log2_count points of Hammersley's set (Niederreiter, "Random Number Generation and Quasi-Monte Carlo Methods" (1992), chapter 3), i < 2^log2_count, log2_count <= 31.
// A power of two, so that i / N is a shift: i / N in f32 reaches 1 beyond 2^24 points.
vec2 hammersley(uint i, uint log2_count)
{
    return vec2(unit_from_bits((i << (31u - log2_count)) << 1), radical_inverse(i));
}

// Two fractions in [0, 1).
vec2 units_from_bits(uvec2 bits)
{
    return vec2(unit_from_bits(bits.x), unit_from_bits(bits.y));
}

// Point i of Sobol's sequence in two dimensions, a (0, 2)-sequence: each aligned run of 2^k points has one in every one of
// the 2^k boxes that halving both sides makes. Scrambled by 32 bits for each dimension: Kollig and Keller, "Efficient
// Multidimensional Sampling" (2002), section 2.2. As fractions of 32 bits.
uvec2 sobol_bits(uint i, uvec2 scramble)
{
    uint second = 0u;
    for (uint rest = i, column = 0x80000000u; rest != 0u; rest >>= 1u, column ^= column >> 1u)
        second ^= (rest & 1u) != 0u ? column : 0u;
    return uvec2(bitfieldReverse(i), second) ^ scramble;
}

// The same as fractions in [0, 1).
vec2 sobol(uint i, uvec2 scramble)
{
    return units_from_bits(sobol_bits(i, scramble));
}

// A unit vector, evenly over the sphere.
vec3 sphere_direction(vec2 u)
{
    float up = 1.0 - 2.0 * u.x, longitude = 2.0 * PI * u.y;
    return vec3(sqrt(max(1.0 - up * up, 0.0)) * vec2(cos(longitude), sin(longitude)), up);
}

// A unit vector by the cosine to +Z: Malley's method, a disc projected up.
vec3 cosine_direction(vec2 u)
{
    float radius = sqrt(u.x), longitude = 2.0 * PI * u.y;
    return vec3(radius * cos(longitude), radius * sin(longitude), sqrt(1.0 - u.x));
}

// A right-handed basis around unit n, as columns tangent, bitangent, n: Duff et al., "Building an Orthonormal Basis,
// Revisited" (2017), listing 3.
mat3 basis(vec3 n)
{
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

// Half vector with density D(h) n.h: Walter et al. (2007), eqs. 35 and 36, as sine and cosine from the tangent.
vec3 sample_ggx(vec2 u, float alpha)
{
    float scale = inversesqrt(max(1.0 - u.x + alpha * alpha * u.x, TINY));
    float sine = alpha * sqrt(u.x) * scale;
    float phi = 2.0 * PI * u.y;
    return vec3(sine * cos(phi), sine * sin(phi), sqrt(1.0 - u.x) * scale);
}

// Density of l = reflect(-v, h) over solid angle for h from sample_ggx: Walter et al. (2007), eqs. 24 and 14.
float pdf_ggx(vec3 v, vec3 h, float alpha)
{
    return d_ggx(vec3(0.0, 0.0, 1.0), h, alpha) * h.z / (4.0 * max(dot(v, h), MIN_COS));
}

// Half vector among those that v sees: Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps" (2023),
// section 3. The cap's sine is a product, not 1 - z^2, in which 1 - stretched.z keeps its digits when written as `below`; the
// cap's height, rise - stretched.z, is not formed: the sum takes it back.
// `alphas`: along x and along y.
vec3 sample_vndf(vec3 v, vec2 u, vec2 alphas)
{
    vec3 stretched = normalize(vec3(alphas * v.xy, max(v.z, MIN_COS)));
    float rise = (1.0 - u.y) * (1.0 + stretched.z);
    float below = dot(stretched.xy, stretched.xy) / (1.0 + stretched.z);
    float sine = sqrt((1.0 + stretched.z) * u.y * (below + rise));
    float phi = 2.0 * PI * u.x;
    vec2 across = sine * vec2(cos(phi), sin(phi)) + stretched.xy;
    return normalize(vec3(alphas * across, max(rise, MIN_COS)));
}

// Density of l = reflect(-v, h) over solid angle for h from sample_vndf: Heitz, "Sampling the GGX Distribution of Visible
// Normals" (2018), eq. 17, with G1 written out so that n.v cancels.
float pdf_vndf(vec3 v, vec3 h, vec2 alphas)
{
    float nv = max(v.z, MIN_COS);
    return d_ggx_stretched(h, alphas) * 0.5 / (nv + length(vec3(alphas * v.xy, nv)));
}

#endif
