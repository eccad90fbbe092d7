// Random numbers from counters.
#ifndef RANDOM_GLSL
#define RANDOM_GLSL

// Four numbers of 32 random bits each from four counters: Jarzynski and Olano, "Hash Functions for GPU Rendering" (2020),
// section on PCG in four dimensions. Integers throughout, so no sample repeats however many frames there are.
uvec4 pcg4d(uvec4 v)
{
    v = v * 1664525u + 1013904223u;
    for (int round = 0; round < 2; ++round) {
        v.x += v.y * v.w;
        v.y += v.z * v.x;
        v.z += v.x * v.y;
        v.w += v.y * v.z;
        v ^= round == 0 ? v >> 16u : uvec4(0u);
    }
    return v;
}

#endif
