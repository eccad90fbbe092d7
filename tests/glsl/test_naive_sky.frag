// The sky with the sampler's own choice of level: what src/render/seam_gpu_tests.rs shows to fail.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "environment.glsl"

layout(location = 0) in vec3 direction_world;
layout(location = 0) out vec4 colour;

void main()
{
    colour = vec4(texture(panorama, panorama_uv(panorama_from_world(normalize(direction_world)))).rgb, 1.0);
}
