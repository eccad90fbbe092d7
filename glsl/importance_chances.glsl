// Chances of a panorama's tiles, as ends of parts of all random numbers of 32 bits: twin of src/reference/importance.rs.
#ifndef IMPORTANCE_CHANCES_GLSL
#define IMPORTANCE_CHANCES_GLSL

// Room for tiles.
const uint TILES = 512;
// Part of all samples that are drawn by the panorama alone, whatever was learned.
const float UNLEARNED = 0.1;
// Units of `Tried.seen`.
const float SEEN_STEPS = 63.0;

// Rays towards a tile from points of one place, and what they met.
struct Tried {
    uint rays;
    uint seen; // sum of squared cosines at those points, of rays that met nothing
};

float chance_of(uint begin, uint end)
{
    return float(end - begin) * (1.0 / 4294967295.0);
}

// A sum of chances, 0 to 1, as an end.
uint end_of(float sum)
{
    return sum >= 1.0 ? 0xffffffffu : uint(sum * 4294967040.0);
}

// How much samples of a tile are worth, 1 before any.
float seen_share(Tried tried)
{
    float rays = float(tried.rays);
    return tried.seen == 0u ? 1.0 / (rays + 1.0) : sqrt(float(tried.seen) / SEEN_STEPS / rays);
}

#endif
