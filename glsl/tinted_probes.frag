// Fragments as tinted.frag's, with mirror images of probes.
#version 460
#extension GL_GOOGLE_include_directive : require
#define TWO_SOURCES
#define LOCAL_PROBES
#include "whole.glsl"
