// Which specular level holds which lobe, and where levels lie; twin of src/reference/levels.rs; no bindings.
#ifndef PBR_VR_LEVELS
#define PBR_VR_LEVELS

const float LAST_LEVEL = 13.0;
const float LAST_SPREAD = 0.4;
const float SPREAD_RATIO = 1.5;
const float LOG2_SPREAD_RATIO = 0.58496250072115618;

// The fractional level for a lobe whose mean vector has length 1 - spread. Mixing two levels mixes their mean vectors, so
// between two levels it is linear in the spread: what it shows of a linear environment is exact.
float level_from_spread(float spread)
{
    float first = LAST_SPREAD * exp2((1.0 - LAST_LEVEL) * LOG2_SPREAD_RATIO);
    if (spread < first)
        return max(spread, 0.0) / first;
    float level = floor(LAST_LEVEL + log2(spread / LAST_SPREAD) / LOG2_SPREAD_RATIO);
    float over = spread / (LAST_SPREAD * exp2((level - LAST_LEVEL) * LOG2_SPREAD_RATIO)) - 1.0;
    return min(level + over / (SPREAD_RATIO - 1.0), LAST_LEVEL);
}

struct LevelMix {
    float even_mip;
    float odd_mip;
    float odd_share; // of the odd level; the even one has the rest
};

// The two levels around a fractional one. Even levels are the mips of one cube map, odd ones those of another, so each of
// two neighbours is one fetch.
LevelMix level_mix(float level)
{
    float odd_mip = floor(0.5 * level);
    return LevelMix(floor(0.5 * level + 0.5), odd_mip, 1.0 - abs(level - (2.0 * odd_mip + 1.0)));
}

#endif
