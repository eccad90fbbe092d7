// Irradiance over pi for each direction n by steps of fixed size, as the thesis has it:
// (1/pi) ∫∫ L cos(theta) sin(theta) dtheta dphi = (pi / N) Σ L cos(theta) sin(theta) over N points of a grid in theta and phi
// that begins at 0, each one tap of mip 0. WITH_SINE = false leaves sin(theta) out, as the thesis's section 2-4-1 does.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "cube.glsl"
#include "sampling.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const bool WITH_SINE = true;
layout(set = 0, binding = 0) uniform samplerCube environment;
layout(set = 0, binding = 1, rgba16f) uniform writeonly image2DArray irradiance_over_pi;
// Counts come from the CPU: a loop over a float ends one step sooner or later, by rounding.
layout(push_constant) uniform Push { float step_radians; uint thetas; uint phis; } push;

void main()
{
    uvec3 id = gl_GlobalInvocationID;
    uint size = uint(imageSize(irradiance_over_pi).x);
    if (id.x >= size || id.y >= size)
        return;
    mat3 world_from_local = basis(cube_direction(id.z, (vec2(id.xy) + 0.5) / float(size)));
    vec3 sum = vec3(0.0);
    for (uint j = 0u; j < push.phis; ++j) {
        float phi = float(j) * push.step_radians;
        vec2 turn = vec2(cos(phi), sin(phi));
        for (uint i = 0u; i < push.thetas; ++i) {
            float theta = float(i) * push.step_radians;
            float sine = sin(theta), cosine = cos(theta);
            vec3 l = world_from_local * vec3(sine * turn, cosine);
            sum += cosine * (WITH_SINE ? sine : 1.0) * textureLod(environment, l, 0.0).rgb;
        }
    }
    imageStore(irradiance_over_pi, ivec3(id), vec4(sum * (PI / float(push.thetas * push.phis)), 1.0));
}
