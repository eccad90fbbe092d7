// Fragments as cutout.frag's, with depth tested after them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_ARB_shader_stencil_export : require
#define LATE_DEPTH
#include "cutout.glsl"
