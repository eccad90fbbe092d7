// What surfaces mirror of the room around them, captured by probes; the panorama where no probe reaches.
#ifndef PROBES_GLSL
#define PROBES_GLSL

#include "draw.glsl"
#include "environment.glsl"
#include "probe_box.glsl"

// Whether a draw's mirror images may be of several, or of one and the panorama.
layout(constant_id = 17) const bool SEVERAL_PROBES = true;

const uint MOST_PROBES = 16;
layout(SCENE_PROBES, scalar) uniform Probes { Probe probes[MOST_PROBES]; }; // uniform: see MAX_COUNTED_LIGHTS
layout(SCENE_PROBE_EVEN) uniform samplerCubeArray probe_even;
layout(SCENE_PROBE_ODD) uniform samplerCubeArray probe_odd;
layout(SCENE_PROBE_IRRADIANCE) uniform samplerCubeArray probe_irradiance_over_pi;

vec3 models_from_world(vec3 d)
{
    return d * mat3(frame.world_from_models);
}

// Radiance from around a direction, of any length, as seen from p in the models' space.
vec3 probe_radiance(int index, Probe probe, vec3 p, vec3 towards, float level)
{
    vec3 d = box_exit(p, models_from_world(towards), probe.low, probe.high) - probe.position;
    LevelMix levels = level_mix(level);
    vec3 even = textureLod(probe_even, vec4(d, index), levels.even_mip).rgb;
    vec3 odd = textureLod(probe_odd, vec4(d, index), levels.odd_mip).rgb;
    return mix(even, odd, levels.odd_share) * frame.probe_scale;
}

// What of the light around the probe reaches a surface, by how much of its irradiance does: the lightmap's over the probe's own.
// Lagarde and de Rousiers, "Moving Frostbite to Physically Based Rendering" (2014), section 4.10.2. The ratio alone would dim
// mirrors, too, wherever light merely differs from that at the probe.
float reach_of_probe(int index, Surface s, vec3 even)
{
    vec3 own = textureLod(probe_irradiance_over_pi, vec4(models_from_world(s.n), index), 0.0).rgb * frame.probe_scale;
    float open = clamp(dot(even, vec3(1.0)) / max(dot(own, vec3(1.0)), 1e-4), 0.0, 1.0);
    return clamp(pow(s.nv + open, exp2(-16.0 * s.roughness - 1.0)) - 1.0 + open, 0.0, 1.0);
}

// What one probe gives of a mirror image at p in the models' space; `even`: irradiance over pi.
vec3 probe_specular(int index, vec3 p, SpecularLobe lobe, Surface s, vec3 even)
{
    vec3 radiance = probe_radiance(index, probes[index], p, lobe.towards, lobe.level);
    return round_reflectance(lobe) * radiance * reach_of_probe(index, s, even);
}

// What the probes around a point give of it; `left`: the share that they leave to the panorama.
vec3 local_specular(SpecularLobe lobe, Surface s, vec3 position, vec3 even, out float left)
{
    vec3 p = models_from_world(position - frame.world_from_models[3].xyz), light = vec3(0.0);
    left = SEVERAL_PROBES ? 1.0 : 0.0;
    if (!SEVERAL_PROBES)
        return probe_specular(findLSB(draw.probes), p, lobe, s, even);
    // Finds the boxes around the point before it reads any probe's light: a software renderer computes what a branch skips, too,
    // and would read every probe.
    uint around = 0u;
    for (uint others = draw.probes; others != 0u; others &= others - 1u) {
        int index = findLSB(others);
        if (probe_weight(p, probes[index]) > 0.0)
            around |= 1u << index;
    }
    do {
        int index = max(findLSB(around), 0);
        around &= around - 1u;
        float weight = probe_weight(p, probes[index]);
        if (weight > 0.0) {
            light += left * weight * probe_specular(index, p, lobe, s, even);
            left *= 1.0 - weight;
        }
    } while (left > 0.0 && around != 0u);
    return light;
}

#endif
