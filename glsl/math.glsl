// Constants and vector helpers that every term file uses; no bindings.
#ifndef PBR_VR_MATH
#define PBR_VR_MATH

const float PI = 3.14159265358979323846;
const float INV_PI = 0.31830988618379067154;

// Smallest cosine that the terms divide by. Cosines of f32 unit vectors carry an absolute error of about 1e-7,
// so what lies below is noise; a maximum, unlike an added epsilon, changes nothing above it.
const float MIN_COS = 1e-7;

// Smallest divisor where the dividend vanishes too: far above f32's smallest normal (1.2e-38), far below any
// value that a term reaches with unit vectors.
const float TINY = 1e-30;

// The unit vector along v, or `otherwise` (unit) where v has no direction: zero, NaN, or as good as infinite.
// Divided by the sum of its sizes first, so that 1e-23 and 1e20 do not under- or overflow when squared.
vec3 normalize_or(vec3 v, vec3 otherwise)
{
    float size = abs(v.x) + abs(v.y) + abs(v.z);
    return size > TINY && size < 1e30 ? normalize(v / size) : otherwise; // both comparisons are false for NaN
}

// Near the largest half.
const float HALF_MOST = 60000.0;

// The nearest number of a half float's ten binary digits, for x >= 0 from 6e-5 on: what a driver then stores as a half is
// this, whichever way it rounds. Some cut off, which would darken every map.
vec3 round_to_half(vec3 x)
{
    return uintBitsToFloat((floatBitsToUint(x) + 0x1000u) & 0xffffe000u);
}

#endif
