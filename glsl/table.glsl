// Where the split sum's table holds which n.v and roughness; twin of src/reference/table.rs; no bindings.
#ifndef PBR_VR_TABLE
#define PBR_VR_TABLE

// n.v from 2^-11 to 1 by its logarithm, because near grazing angles everything depends on n.v / alpha; roughness by its
// third root. The outermost texels' centres are the ends.
const float TABLE_OCTAVES = 11.0;

vec2 table_coordinate(float nv, float roughness, vec2 size)
{
    vec2 at = vec2(log2(max(nv, 1e-7)) / TABLE_OCTAVES + 1.0, pow(max(roughness, 0.0), 1.0 / 3.0));
    return (clamp(at, 0.0, 1.0) * (size - 1.0) + 0.5) / size;
}

// n.v and roughness of a texel.
vec2 table_arguments(uvec2 texel, uvec2 size)
{
    vec2 at = vec2(texel) / vec2(size - 1u);
    return vec2(exp2((at.x - 1.0) * TABLE_OCTAVES), at.y * at.y * at.y);
}

#endif
