// Follows light from the lamps, evenly to all sides, to the first places that it meets.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lightmap.glsl"

void main()
{
    if (gl_GlobalInvocationID.x >= work.count)
        return;
    uint index = work.first + gl_GlobalInvocationID.x;
    PointLight lamp = lights[index % frame.light_count];
    vec3 d = sphere_direction(sobol(index / frame.light_count, pcg4d(uvec4(0u)).xy));
    RayHit hit = trace_ray(lamp.position, d, 1e30, false);
    relays[index] = Relay(vec3(0.0), d, vec3(0.0), 0.0, 0u, vec3(0.0), vec3(0.0));
    if (hit.t < 0.0)
        return;
    PathPoint p = ray_point(hit, d);
    vec3 at = lightmap_address(hit, is_back(hit, d));
    vec4 given = textureLod(given_back_of_direct, at, 0.0);
    uint glossy = textureLod(given_back_of_soft, at, 0.0).a > 0.5 ? RELAY_GLOSSY : 0u;
    vec3 position = p.position + 2.0 * p.rounding * p.side;
    relays[index] = Relay(position, p.side, given.rgb, given.a, hit.triangle | glossy, hit.weights, at);
}
