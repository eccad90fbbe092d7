// Fragments of sheets that colour what is behind them.
#version 460
#extension GL_GOOGLE_include_directive : require
#define TWO_SOURCES
#include "whole.glsl"
