// Fragments of surfaces with holes, where there are four samples per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cutout.glsl"
