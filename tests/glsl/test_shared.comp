// Reads every member of shared.glsl's blocks by name, for src/render/shared_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "instance.glsl"

layout(local_size_x = 1) in;
layout(set = 2, binding = 0, scalar) writeonly buffer Outputs { float outputs[]; };

uint count = 0;
void put(float value) { outputs[count++] = value; }
void put(vec4 value) { for (int i = 0; i < 4; ++i) put(value[i]); }
void put(mat4 value) { for (int i = 0; i < 4; ++i) put(value[i]); }

void main()
{
    for (uint i = 0; i < MAX_EYES; ++i) {
        put(frame.eyes[i].clip_from_world);
        put(frame.eyes[i].world_from_view);
        put(frame.eyes[i].tangents);
    }
    put(frame.environment_rotation.x);
    put(frame.environment_rotation.y);
    put(frame.exposure);
    put(frame.environment_scale);
    put(float(frame.light_count));
    put(float(frame.sample_index));
    put(frame.world_from_models);
    put(vec4(frame.sun.towards, 0.0));
    put(vec4(frame.sun.irradiance, frame.sun.sine));
    put(frame.sun_shadow.place_from_world);
    put(frame.sun_shadow.spread.x);
    put(frame.sun_shadow.spread.y);
    for (uint i = 0; i < MAX_SPHERE_LIGHTS; ++i) {
        SphereLight light = frame.sphere_lights[i];
        put(vec4(light.position, light.radius));
        put(vec4(light.intensity, light.shadow_near));
        put(float(light.shadow_layer));
    }
    for (uint i = 0; i < lights.length(); ++i) {
        put(vec4(lights[i].position, lights[i].radius));
        put(vec4(lights[i].intensity, lights[i].shadow_near));
        put(float(lights[i].shadow_layer));
        put(vec4(lights[i].along, lights[i].cone.x));
        put(lights[i].cone.y);
    }
    for (uint i = 0; i < instances.length(); ++i) {
        put(instances[i].world_from_local);
        put(float(instances[i].material));
    }
    for (uint i = 0; i < materials.length(); ++i) {
        put(vec4(materials[i].base_color, materials[i].metallic));
        put(materials[i].roughness);
        put(materials[i].alpha_cutoff);
        put(float(materials[i].textures));
        put(materials[i].opacity);
        put(materials[i].emission.x);
        put(materials[i].emission.y);
        put(materials[i].emission.z);
        put(float(materials[i].flags));
        put(materials[i].dielectric.f0.x);
        put(materials[i].dielectric.f0.y);
        put(materials[i].dielectric.f0.z);
        put(materials[i].dielectric.f90);
        put(materials[i].dielectric.film.share);
        put(materials[i].dielectric.film.ior);
        put(materials[i].dielectric.film.thickness);
        put(materials[i].dielectric.film.base_f0.x);
        put(materials[i].dielectric.film.base_f0.y);
        put(materials[i].dielectric.film.base_f0.z);
        put(materials[i].film_thinnest);
        put(materials[i].transmission.x);
        put(materials[i].transmission.y);
        put(materials[i].transmission.z);
        put(materials[i].clearcoat);
        put(materials[i].clearcoat_roughness);
        put(materials[i].surface_transmission.x);
        put(materials[i].surface_transmission.y);
        put(materials[i].surface_transmission.z);
        put(materials[i].absorption.x);
        put(materials[i].absorption.y);
        put(materials[i].absorption.z);
        put(materials[i].ior);
        put(materials[i].ior_spread);
        put(materials[i].body_centre.x);
        put(materials[i].body_centre.y);
        put(materials[i].body_centre.z);
        put(materials[i].body_radius);
        put(materials[i].sheen.x);
        put(materials[i].sheen.y);
        put(materials[i].sheen.z);
        put(materials[i].sheen_roughness);
        put(materials[i].anisotropy.x);
        put(materials[i].anisotropy.y);
        put(materials[i].diffuse_transmission);
        put(materials[i].diffuse_transmission_color.x);
        put(materials[i].diffuse_transmission_color.y);
        put(materials[i].diffuse_transmission_color.z);
        put(float(materials[i].extension));
    }
}
