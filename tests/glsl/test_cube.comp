// What cube.glsl computes, for src/precompute/glsl_gpu_tests.rs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cube.glsl"

struct Input {
    vec3 d;
    vec2 st, uv, cos_sin;
    uint face, cube_size, row;
    uvec2 texel, panorama_size;
};
struct Output {
    vec3 direction, face, panorama_direction, turned;
    vec2 uv;
    float cube_texel, panorama_texel;
};
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer Inputs { Input inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { Output outputs[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= inputs.length())
        return;
    Input i = inputs[id];
    outputs[id] = Output(cube_direction(i.face, i.st), cube_face(i.d), panorama_direction(i.uv),
                         rotate_y(i.d, i.cos_sin), panorama_uv(i.d), cube_texel_solid_angle(i.texel, i.cube_size),
                         panorama_texel_solid_angle(i.row, i.panorama_size));
}
