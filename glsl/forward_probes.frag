// Fragments as forward.frag's, with mirror images from probes: for GPUs that have arrays of cubes.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LOCAL_PROBES
#include "whole.glsl"
