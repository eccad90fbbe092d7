// From scene radiance to display values, twins of src/reference/tone.rs; no bindings.
#ifndef PBR_VR_TONE
#define PBR_VR_TONE

// What radiance is multiplied by for an exposure in stops.
float exposure_scale(float ev)
{
    return exp2(ev);
}

// Relative luminance of linear RGB with Rec. 709 / sRGB primaries: ITU-R BT.709-6, item 3.2.
float luminance(vec3 rgb)
{
    return dot(rgb, vec3(0.2126, 0.7152, 0.0722));
}

// Khronos PBR Neutral Tone Mapper (Khronos Group, 2024, its specification's equations): linear RGB in, linear display RGB
// in [0, 1] out. Colours up to 0.8 - 0.04 come out as the albedo that went in, less the 4 % that a dielectric's surface adds.
vec3 tone_neutral(vec3 rgb)
{
    const float FRESNEL = 0.04;             // the reflection of a dielectric, taken off again
    const float START = 0.8 - FRESNEL;      // peak where compression starts
    const float DESATURATION = 0.15;        // speed of the way to white

    rgb = clamp(rgb, 0.0, 1e30); // keeps infinity out of infinity * 0
    float low = min(rgb.r, min(rgb.g, rgb.b));
    rgb -= low < 2.0 * FRESNEL ? low - low * low / (4.0 * FRESNEL) : FRESNEL;
    float peak = max(rgb.r, max(rgb.g, rgb.b));
    if (peak <= START)
        return rgb;
    const float ROOM = 1.0 - START;
    float compressed = 1.0 - ROOM * ROOM / (peak + ROOM - START);
    float whiten = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    return mix(rgb * (compressed / peak), vec3(compressed), whiten);
}

// sRGB's transfer function, linear [0, 1] to encoded [0, 1]: IEC 61966-2-1, section 5.2.
vec3 srgb_encode(vec3 linear)
{
    vec3 curved = 1.055 * pow(max(linear, 0.0031308), vec3(1.0 / 2.4)) - 0.055;
    return mix(curved, linear * 12.92, lessThanEqual(linear, vec3(0.0031308)));
}

// Its inverse.
vec3 srgb_decode(vec3 encoded)
{
    vec3 curved = pow((max(encoded, 0.04045) + 0.055) / 1.055, vec3(2.4));
    return mix(curved, encoded / 12.92, lessThanEqual(encoded, vec3(0.04045)));
}

#endif
