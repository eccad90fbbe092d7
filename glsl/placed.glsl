// Push constants of draws by `placed.vert`: see src/render/surface_pass.rs.
#ifndef PLACED_GLSL
#define PLACED_GLSL

#extension GL_EXT_scalar_block_layout : require

layout(push_constant, scalar) uniform Draw {
    mat4 clip_from_models;
    uint instance;
} draw;

#endif
