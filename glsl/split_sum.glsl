// What stands for the specular lobe: a share of the irradiance, and round lobes; twin of src/reference/split_sum.rs; no bindings.
#ifndef PBR_VR_SPLIT_SUM
#define PBR_VR_SPLIT_SUM

struct Match {
    float even;   // the weight of irradiance / pi; the round lobes have the rest of 1
    vec2 towards; // the direction of their mean along r and along n - (n.v) r, of any length
    float spread; // 1 - length of their mean
};

// Two round lobes, along towards + apart and towards - apart; a single one where these are the same.
struct Pair {
    vec2 apart;
    float spread; // of each
};

// The weight of irradiance / pi, over `along` of the part of the lobe that it is for: fitted.
float even_over_along(float nv, float roughness)
{
    float wide = mix(0.76, 0.92 / (1.0 - 2.0 / 3.0 * nv), smoothstep(0.35, 0.95, roughness));
    return mix(wide, nv, smoothstep(0.85, 1.0, roughness));
}

// How much of a match's spread is the angle between two lobes, over sin^2 of that from n to v: fitted.
float apart_over_sin2(float roughness)
{
    return 2.2 * roughness * max(0.8 - roughness, 0.0);
}

// For a lobe with the mean vector (1 - along) r + lean (n - (n.v) r): the round lobes have what 2/3 n, that of the cosine's lobe,
// leaves of it.
Match match_lobe(float even, float along, float lean, float nv, float sin2)
{
    float third = 2.0 / 3.0 * even, weight = 1.0 - even;
    along += third * nv - even;
    lean -= third;
    float across2 = lean * lean * sin2;
    float length_towards = sqrt((weight - along) * (weight - along) + across2);
    // weight^2 - length^2, without its loss of digits near a mirror.
    float squares = 2.0 * weight * along - along * along - across2;
    return Match(even, vec2(weight - along, lean), squares / (weight * (weight + length_towards)));
}

// The spread where normals turn within the pixel, by this variance along both axes together: the mirror direction turns by twice as
// much in the plane of incidence, by 2 n.v as much across it. Rims and rods thinner than a pixel would flash without.
float turned_spread(float spread, float nv, float variance)
{
    return 1.0 - (1.0 - spread) / (1.0 + variance * (1.0 + nv * nv));
}

// Of the same mean: with the cosine 1 - s between `towards` and each lobe, (1 - s) (1 - spread of each) = 1 - spread.
Pair split_lobe(Match whole, float share, float sin2)
{
    float s = share * sin2 * whole.spread, rest = 1.0 / (1.0 - s);
    // The tangent of that angle over sin: the turn is within the plane of incidence, where n - (n.v) r is as long as sin.
    float slope = sqrt(share * whole.spread * (2.0 - s)) * rest;
    return Pair(slope * vec2(-whole.towards.y * sin2, whole.towards.x), (whole.spread - s) * rest);
}

#endif
