// Instances and materials, one after the other in buffers.
#ifndef INSTANCE_GLSL
#define INSTANCE_GLSL

#include "shared.glsl"

struct Instance {
    mat4 world_from_local; // rotation, uniform scale, translation
    uint material;
};

struct Material {
    vec3 base_color;
    float metallic;
    float roughness;
    float alpha_cutoff;
    uint textures; // the set they are drawn with
};

layout(SCENE_INSTANCES, scalar) readonly buffer Instances { Instance instances[]; };
layout(SCENE_MATERIALS, scalar) readonly buffer Materials { Material materials[]; };

#endif
