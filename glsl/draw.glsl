// Push constants of draws: see src/render/forward.rs.
#ifndef DRAW_GLSL
#define DRAW_GLSL

#extension GL_EXT_scalar_block_layout : require

layout(push_constant, scalar) uniform Draw {
    uint instance;
    uint probes; // a bit for each that may give mirror images, the lowest for the first
} draw;

#endif
