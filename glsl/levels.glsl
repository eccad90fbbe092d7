// Which specular level holds which lobe, and where levels lie; twin of src/reference/levels.rs; no bindings.
#ifndef PBR_VR_LEVELS
#define PBR_VR_LEVELS

const float LAST_LEVEL = 9.0;

// Spread of the lobe of level 1 and above; its fourth root grows evenly.
float spread_from_level(float level)
{
    float root = 0.165 + 0.07 * level;
    return root * root * root * root;
}

// The fractional level for a lobe whose mean vector has length 1 - spread. Mixing two lobes mixes their mean vectors, so
// between two levels it is linear in the spread: what it shows of a linear environment is exact. Below the first lobe it
// is linear in the spread's root, about alpha.
float level_from_spread(float spread)
{
    float first = spread_from_level(1.0);
    if (spread < first)
        return sqrt(max(spread, 0.0) / first);
    float low = clamp(floor((sqrt(sqrt(spread)) - 0.165) / 0.07), 1.0, LAST_LEVEL - 1.0);
    float below = spread_from_level(low);
    return low + min((spread - below) / (spread_from_level(low + 1.0) - below), 1.0);
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
