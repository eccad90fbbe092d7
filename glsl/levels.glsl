// Which specular level holds which roughness; twin of src/reference/levels.rs; no bindings.
#ifndef PBR_VR_LEVELS
#define PBR_VR_LEVELS

// alpha of a stored level: 0 at level 0 (the panorama itself), then doubling up to 1 at the last, as texels double in size.
float alpha_from_level(float level, float last_level)
{
    return level < 1.0 ? level * exp2(1.0 - last_level) : exp2(level - last_level);
}

// The fractional level for a roughness, alpha = roughness^2; the inverse of the above.
float level_from_roughness(float roughness, float last_level)
{
    float alpha = roughness * roughness;
    float first = exp2(1.0 - last_level);
    return alpha < first ? alpha / first : last_level + log2(min(alpha, 1.0));
}

#endif
