// Data that Rust writes and GLSL reads; the same as src/render/shared.rs.
#ifndef SHARED_GLSL
#define SHARED_GLSL
#extension GL_EXT_scalar_block_layout : require
#include "bindings.glsl"

const uint MAX_EYES = 4;

struct Eye {
    mat4 clip_from_world;
    mat4 world_from_view;
    vec4 tangents; // left, right, down, up
};

struct PointLight {
    vec3 position;     // metres, world
    float radius;      // metres, 0 for a point
    vec3 intensity;    // W/sr
    float shadow_near; // metres
    int shadow_layer;  // the first of six, below 0 without a shadow map
    vec3 along;        // unit vector along a spot light's axis
    vec2 cone;         // factor and summand of the cosine to it; 0, 1 for light to all sides
};

// A surface that shines, as a sphere, in the models' space: mirror images show it beside what probes captured.
const uint MAX_SPHERE_LIGHTS = 8;
struct SphereLight {
    vec3 position; // metres
    float radius;
    vec3 intensity;    // W/sr
    float shadow_near; // as of a PointLight
    int shadow_layer;
};

// A disc far away, in world space; irradiance 0 where there is none.
struct SunDisc {
    vec3 towards;    // unit vector to its centre
    vec3 irradiance; // of a surface that faces it, W/m^2
    float sine;      // of its angular radius
};

// The sun's shadow map.
struct SunShadow {
    mat4 place_from_world; // u, v and reversed depth
    vec2 spread;           // radius of the sun's disc in uv, seen through a hole, per depth between hole and point
};

layout(constant_id = 0) const uint EYES = 1;
layout(constant_id = 1) const uint SHADING = 0;
layout(constant_id = 2) const int GEOMETRY = 0;
layout(constant_id = 3) const bool LINEAR_OUTPUT = false;
layout(constant_id = 4) const bool HAS_BASE_COLOR_MAP = true;
layout(constant_id = 5) const bool HAS_NORMAL_MAP = true;
layout(constant_id = 6) const bool HAS_ORM_MAP = true;
layout(constant_id = 7) const bool ALPHA_MASK = false;
layout(constant_id = 8) const int LIGHTS = -1; // below 0: as many as the frame says
layout(constant_id = 9) const uint METALNESS = 2;
layout(constant_id = 10) const bool MULTI_SCATTER = true; // with GEOMETRY_SMITH alone
layout(constant_id = 15) const uint LIGHTMAP = 0;
layout(constant_id = 11) const uint SPLIT_SUM = 3; // the order of reference::split_sum::SplitSum
layout(constant_id = 12) const bool SUN = false; // the sun is a light of its own
layout(constant_id = 13) const uint LAMP_SHADOWS = 0;
layout(constant_id = 14) const bool SUN_SHADOW = false; // the sun has a shadow map
layout(constant_id = 19) const bool EMITS = true;
layout(constant_id = 20) const uint VERTEX_COLOURS = 0;
layout(constant_id = 21) const uint SECOND_UV = 0; // bit i: map i is looked up by the second texture coordinates
layout(constant_id = 22) const bool BLENDS = false;  // alpha is coverage
layout(constant_id = 29) const bool SPECULAR = false; // dielectrics reflect colours apart, or not all at grazing angles
layout(constant_id = 25) const bool TINTS = false;   // what is behind is seen in another colour
#ifdef CORE_MATERIALS
const bool CLEARCOAT = false;
const bool SHEEN = false;
const bool ANISOTROPY = false;
const bool FILM = false;
const uint EXTENSION_MAP_OF = 0;
const bool DIFFUSE_TRANSMISSION = false;
const bool REFRACTS = false;
const bool DISPERSES = false;
#else
layout(constant_id = 26) const bool CLEARCOAT = false;
layout(constant_id = 28) const bool SHEEN = false;
layout(constant_id = 30) const bool ANISOTROPY = false; // stretched highlights
layout(constant_id = 31) const bool FILM = false; // a thin film; with SPECULAR
layout(constant_id = 32) const uint EXTENSION_MAP_OF = 0;
layout(constant_id = 33) const bool DIFFUSE_TRANSMISSION = false; // light diffuses through
layout(constant_id = 27) const bool REFRACTS = false; // convex bodies show what is around them
layout(constant_id = 34) const bool DISPERSES = false; // and split its light
#endif
layout(constant_id = 23) const uint SPHERE_LIGHTS = 0;

// LAMP_SHADOWS: the order of render::shadow_plan::LampShadows.
const uint LAMP_SHADOWS_NONE = 0;
const uint LAMP_SHADOWS_SHARP = 1; // every lamp is a point
const uint LAMP_SHADOWS_SOFT = 2;

// METALNESS: the order of scene::needs::Metalness.
const uint METALNESS_DIELECTRIC = 0;
const uint METALNESS_METAL = 1;
const uint METALNESS_MIXED = 2;

// EXTENSION_MAP_OF: the order of asset::material::Extension.
const uint EXTENSION_NONE = 0;
const uint EXTENSION_SPECULAR = 1;
const uint EXTENSION_SHEEN = 2;
const uint EXTENSION_ANISOTROPY = 3;
const uint EXTENSION_DIFFUSE_TRANSMISSION = 4;
const uint EXTENSION_BODY = 5;
const uint EXTENSION_FACES = 6;

// LIGHTMAP: soft light comes from the environment's maps, or from the scene's lightmap, of fronts alone or of both sides.
const uint LIGHTMAP_NONE = 0;
const uint LIGHTMAP_FRONTS = 1;
const uint LIGHTMAP_BOTH = 2;
// Kinds of the lightmap's layers, in their order, each of as many layers as LIGHTMAP says: soft light as irradiance; the mean direction
// that meets nothing; the mean radiance of what others meet.
const uint LIGHTMAP_IRRADIANCE = 0;
const uint LIGHTMAP_OPENNESS = 1;
const uint LIGHTMAP_BLOCKERS = 2;
const uint LIGHTMAP_KINDS = 3;
// What vertices count lightmap coordinates in, from 0 to 1.
const uint LIGHTMAP_STEPS = 49152;

// VERTEX_COLOURS: what they multiply.
const uint COLOURS_OF_NOTHING = 0;
const uint COLOURS_OF_BASE = 1; // base color and alpha
const uint COLOURS_OF_EMISSION = 2; // and emission

// SHADING: the order of render::Shading.
const uint SHADING_PBR = 0;
const uint SHADING_PHONG = 1;
const uint SHADING_BASE_COLOR = 2;
const uint SHADING_NORMAL = 3;
const uint SHADING_METALLIC = 4;
const uint SHADING_ROUGHNESS = 5;
const uint SHADING_OCCLUSION = 6;
const uint SHADING_UV = 7;
const uint SHADING_TANGENT = 8;
const uint SHADING_D = 9;
const uint SHADING_F = 10;
const uint SHADING_G = 11;
const uint SHADING_DIFFUSE = 12;
const uint SHADING_SPECULAR = 13;
const uint SHADING_IRRADIANCE = 14;
const uint SHADING_REFERENCE = 15;

layout(FRAME_UNIFORMS, scalar) uniform Frame {
    Eye eyes[MAX_EYES];
    vec2 environment_rotation; // cos, sin
    float exposure;
    float environment_scale;
    uint light_count;
    uint sample_index; // frames accumulated before this one
    mat4 world_from_models; // rigid
    SunDisc sun;
    SunShadow sun_shadow;
    SphereLight sphere_lights[MAX_SPHERE_LIGHTS];
} frame;

layout(SCENE_LIGHTS, scalar) readonly buffer Lights {
    PointLight lights[];
};

// The same where LIGHTS is their number: lavapipe reads a uniform buffer once for all fragments, a storage buffer for each.
const uint MAX_COUNTED_LIGHTS = 64;
layout(SCENE_COUNTED_LIGHTS, scalar) uniform CountedLights {
    PointLight counted_lights[MAX_COUNTED_LIGHTS];
};

layout(SCENE_PANORAMA) uniform sampler2D panorama;
layout(SCENE_IRRADIANCE) uniform samplerCube irradiance_over_pi;
layout(SCENE_SPECULAR_EVEN) uniform samplerCube specular_even;
layout(SCENE_SPECULAR_ODD) uniform samplerCube specular_odd;
layout(SCENE_BRDF_TABLE) uniform sampler2DArray brdf_table;
layout(SCENE_LIGHTMAP) uniform sampler2DArray lightmap; // layers: see LIGHTMAP_KINDS; fronts before backs
layout(SCENE_LAMP_SHADOWS) uniform sampler2DArrayShadow lamp_shadows;
layout(SCENE_LAMP_DEPTHS) uniform sampler2DArray lamp_depths; // the same image
layout(SCENE_LAMP_TRANSMISSION) uniform sampler2DArray lamp_transmission;
layout(SCENE_SUN_TRANSMISSION) uniform sampler2DArray sun_transmission;
layout(SCENE_SUN_SHADOW) uniform sampler2DArrayShadow sun_shadows; // one layer
layout(SCENE_SUN_DEPTH) uniform sampler2DArray sun_depths;

#endif
