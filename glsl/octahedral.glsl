// A vertex's normal and tangent from four numbers in [-1, 1]; twins of src/reference/octahedral.rs; no bindings.
#ifndef PBR_VR_OCTAHEDRAL
#define PBR_VR_OCTAHEDRAL

// The point of a direction of any length.
vec2 octahedral_encode(vec3 d)
{
    d /= abs(d.x) + abs(d.y) + abs(d.z);
    vec2 folded = (1.0 - abs(d.yx)) * vec2(d.x >= 0.0 ? 1.0 : -1.0, d.y >= 0.0 ? 1.0 : -1.0);
    return d.z >= 0.0 ? d.xy : folded;
}

// The unit vector of a point of the octahedron unfolded to [-1, 1]^2: Meyer et al., "On Floating-Point Normal Vectors"
// (2010), section 3.
vec3 octahedral_decode(vec2 p)
{
    // Below the square's diagonals z is negative, and both coordinates lie as far beyond them as -z says.
    float z = 1.0 - abs(p.x) - abs(p.y);
    float beyond = max(-z, 0.0);
    p += vec2(p.x >= 0.0 ? -beyond : beyond, p.y >= 0.0 ? -beyond : beyond);
    return normalize(vec3(p, z));
}

vec3 frame_normal(vec4 frame)
{
    return octahedral_decode(frame.xy);
}

// The tangent, and the bitangent's sign: of the last number, the sign is this sign, and twice the size less 1 is the
// second coordinate.
vec4 frame_tangent(vec4 frame)
{
    return vec4(octahedral_decode(vec2(frame.z, 2.0 * abs(frame.w) - 1.0)), frame.w < 0.0 ? -1.0 : 1.0);
}

#endif
