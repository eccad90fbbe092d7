// Traces rays, for src/render/ray_scene.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "bvh.glsl"

layout(local_size_x = 64) in;

struct Ray {
    vec3 o, d;
    float far;
};
struct Met {
    float t;
    uint triangle;
    vec3 weights;
    uint any;
};
layout(set = 0, binding = 0, scalar) readonly buffer Rays { Ray rays[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer AllMet { Met met[]; };

bool is_hole(RayHit hit, float cosine, out vec3 through)
{
    through = vec3(1.0);
    return false;
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= rays.length())
        return;
    Ray ray = rays[i];
    RayHit any = bvh_trace(ray.o, ray.d, ray.far, true);
    RayHit nearest = bvh_trace(ray.o, ray.d, ray.far, false);
    met[i] = Met(nearest.t, nearest.triangle, nearest.weights, any.t >= 0.0 ? 1u : 0u);
}
