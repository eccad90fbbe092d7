// Push constants of draws: see src/render/forward.rs.
#ifndef DRAW_GLSL
#define DRAW_GLSL

#extension GL_EXT_scalar_block_layout : require

layout(push_constant, scalar) uniform Draw {
    uint instance;
    uint probe; // that gives all mirror images, where PROBES is 0
} draw;

#endif
