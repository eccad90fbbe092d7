// What stands for the specular lobe: a share of the irradiance, and a round lobe; twin of Match in src/reference/table.rs; no
// bindings.
#ifndef PBR_VR_SPLIT_SUM
#define PBR_VR_SPLIT_SUM

struct Match {
    float even;   // the weight of irradiance / pi; the round lobe has the rest of 1
    vec2 towards; // the round lobe's direction along r and along n - (n.v) r, of any length
    float spread;
};

// For a lobe with the mean vector (1 - along) r + lean (n - (n.v) r): the round lobe has what 2/3 n, that of the cosine's lobe,
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

#endif
