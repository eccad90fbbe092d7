// What surfaces mirror of the room around them, captured by probes; the panorama where no probe reaches.
#ifndef PROBES_GLSL
#define PROBES_GLSL

#include "draw.glsl"
#include "environment.glsl"
#include "placed_probes.glsl"

// Whether a draw's mirror images may be of several, or of one and the panorama.
layout(constant_id = 17) const bool SEVERAL_PROBES = true;

layout(SCENE_PROBE_EVEN) uniform samplerCubeArray probe_even;
layout(SCENE_PROBE_ODD) uniform samplerCubeArray probe_odd;

// What a probe shows at p, in the models' space, around a world direction: the light that surfaces give back, radiance, and the
// share of the panorama, which lies behind them.
vec4 probe_around(int index, vec3 p, vec3 towards, LevelMix levels)
{
    Probe probe = probes[index];
    vec3 d = box_exit(p, models_from_world(towards), probe.low, probe.high) - probe.position;
    vec4 even = textureLod(probe_even, vec4(d, index), levels.even_mip), odd = textureLod(probe_odd, vec4(d, index), levels.odd_mip);
    return mix(even, odd, levels.odd_share);
}

// The mean of the round lobes; see environment_image.
vec4 probe_image(int index, vec3 p, SpecularLobe lobe)
{
    LevelMix levels = level_mix(lobe.level);
    vec4 sum = vec4(0.0);
    bool two = lobe.apart != vec3(0.0);
    float side = 1.0, last = two ? -1.0 : 1.0;
    do {
        if (side >= last)
            sum += probe_around(index, p, lobe.towards + side * lobe.apart, levels);
        side -= 2.0;
    } while (side >= last);
    return two ? 0.5 * sum : sum;
}

// The same of all probes around a point; `left`: the share that none of them reaches, all of it the panorama's.
vec4 probes_image(SpecularLobe lobe, vec3 position, out float left)
{
    vec3 p = position_in_models(position);
    left = SEVERAL_PROBES ? 1.0 : 0.0;
    if (!SEVERAL_PROBES)
        return probe_image(findLSB(draw.probes), p, lobe);
    // Finds the boxes around the point before it reads any probe's light: a software renderer computes what a branch skips, too,
    // and would read every probe.
    uint around = 0u;
    for (uint others = draw.probes; others != 0u; others &= others - 1u) {
        int index = findLSB(others);
        if (probe_weight(p, probes[index]) > 0.0)
            around |= 1u << index;
    }
    vec4 image = vec4(0.0);
    do {
        int index = max(findLSB(around), 0);
        around &= around - 1u;
        float weight = probe_weight(p, probes[index]);
        if (weight > 0.0) {
            image += left * weight * probe_image(index, p, lobe);
            left *= 1.0 - weight;
        }
    } while (left > 0.0 && around != 0u);
    return image + vec4(vec3(0.0), left);
}

#endif
