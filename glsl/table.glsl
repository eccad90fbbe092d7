// Where the split sum's table holds which n.v and roughness; twin of src/reference/table.rs; no bindings.
#ifndef PBR_VR_TABLE
#define PBR_VR_TABLE

// n.v by log(1 + 1024 n.v), because near grazing angles everything depends on n.v / alpha; roughness by its third root.
// The outermost texels' centres are the ends, 0 and 1.
const float TABLE_STEEPNESS = 1024.0;

vec2 table_coordinate(float nv, float roughness, vec2 size)
{
    float x = log2(1.0 + TABLE_STEEPNESS * nv) / log2(1.0 + TABLE_STEEPNESS);
    vec2 at = vec2(x, pow(max(roughness, 0.0), 1.0 / 3.0));
    return (clamp(at, 0.0, 1.0) * (size - 1.0) + 0.5) / size;
}

// n.v and roughness of a texel.
vec2 table_arguments(uvec2 texel, uvec2 size)
{
    vec2 at = vec2(texel) / vec2(size - 1u);
    return vec2((exp2(at.x * log2(1.0 + TABLE_STEEPNESS)) - 1.0) / TABLE_STEEPNESS, at.y * at.y * at.y);
}

#endif
