// The energy terms' entries, looked up in the split sum's table.
#ifndef PBR_VR_ENERGY_TABLE
#define PBR_VR_ENERGY_TABLE

#include "shared.glsl"
#include "energy.glsl"
#include "table.glsl"

vec2 entry_coordinate(float cosine, float roughness)
{
    return table_coordinate(cosine, roughness, vec2(textureSize(brdf_table, 0).xy));
}

// The entry at n.l or n.v.
vec2 entry_at(float cosine, float roughness)
{
    return textureLod(brdf_table, vec3(entry_coordinate(cosine, roughness), 0.0), 0.0).xy;
}

// The terms at a roughness.
Energy energy_at(float roughness)
{
    return Energy(textureLod(brdf_table, vec3(entry_coordinate(1.0, roughness), 1.0), 0.0).zw, MULTI_SCATTER);
}

#endif
