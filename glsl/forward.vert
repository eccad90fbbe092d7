// Places a vertex of one instance in one eye's layer.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_shader_viewport_layer_array : require
#include "draw.glsl"
#include "instance.glsl"
#include "octahedral.glsl"

layout(location = 0) in vec3 position_local;
layout(location = 1) in vec4 frame_local; // normal and tangent, packed
layout(location = 2) in vec2 uv_in;
layout(location = 3) in vec2 lightmap_uv_in;

// Centroid: at a triangle's edge, attributes taken outside of it give normals that sparkle.
layout(location = 0) centroid out vec4 covered_position; // in the world, with 1
layout(location = 1) centroid out vec3 normal_world;
layout(location = 2) out vec2 uv;
layout(location = 3) centroid out vec4 tangent_world;
layout(location = 4) flat out uint eye;
// The material: read here, because lavapipe reads buffers lane by lane, which costs fragments 6 % of a frame.
layout(location = 5) flat out vec4 base_color_metallic;
layout(location = 6) flat out vec4 surface_factors; // roughness, alpha cutoff, F0 of what is no metal, if not SPECULAR, whether it transmits
// Centroid: outside of its triangle a coordinate would reach into another chart.
layout(location = 8) centroid out vec2 covered_lightmap_uv;
// At the pixel's centre, whose neighbours span the triangle's plane.
layout(location = 7) out vec3 position_centre;
layout(location = 9) centroid out vec4 vertex_colour;
layout(location = 10) out vec2 uv1;
layout(location = 11) flat out vec4 emission_opacity;

vec3 world_direction(mat4 models_from_local, vec3 local)
{
    return mat3(frame.world_from_models) * (mat3(models_from_local) * local);
}

void main()
{
    eye = gl_InstanceIndex % EYES;
    Material material = materials[instances[draw.instance].material];
    base_color_metallic = vec4(material.base_color, material.metallic);
    float transmits = (material.flags & MATERIAL_TRANSMITS) != 0u ? 1.0 : 0.0;
    surface_factors = vec4(material.roughness, material.alpha_cutoff, material.dielectric.f0.r, transmits);
    emission_opacity = vec4(material.emission, material.opacity);
    vertex_colour = VERTEX_COLOURS != COLOURS_OF_NOTHING ? unpacked_colour(vertex_extras[gl_VertexIndex]) : vec4(1.0);
    uv1 = SECOND_UV != 0u ? vertex_extras[gl_VertexIndex].uv1 : vec2(0.0);
    mat4 models_from_local = instances[draw.instance].world_from_local;
    // One after the other: models that were not moved stay where they are to the last bit.
    vec4 world = frame.world_from_models * (models_from_local * vec4(position_local, 1.0));
    covered_position = world;
    position_centre = world.xyz;
    normal_world = normalize(world_direction(models_from_local, frame_normal(frame_local)));
    vec4 tangent_local = frame_tangent(frame_local);
    tangent_world = vec4(normalize(world_direction(models_from_local, tangent_local.xyz)), tangent_local.w);
    uv = uv_in;
    covered_lightmap_uv = lightmap_uv_in * (65535.0 / float(LIGHTMAP_STEPS));
    gl_Position = frame.eyes[eye].clip_from_world * world;
    gl_Layer = int(eye);
}
