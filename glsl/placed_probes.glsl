// The probes that are placed in a scene.
#ifndef PLACED_PROBES_GLSL
#define PLACED_PROBES_GLSL

#include "probe_box.glsl"

const uint MOST_PROBES = 16;
layout(SCENE_PROBES, scalar) uniform Probes { Probe probes[MOST_PROBES]; }; // uniform: see MAX_COUNTED_LIGHTS

// Their space.
vec3 models_from_world(vec3 d)
{
    return d * mat3(frame.world_from_models);
}

vec3 position_in_models(vec3 position)
{
    return models_from_world(position - frame.world_from_models[3].xyz);
}

#endif
