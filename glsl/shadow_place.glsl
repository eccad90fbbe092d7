// Where a point lies in a shadow map, and how the depth of its plane changes there; twins of src/reference/shadow.rs; no
// bindings. Depth is reversed: 1 nearest to the light, 0 farthest.
#ifndef PBR_VR_SHADOW_PLACE
#define PBR_VR_SHADOW_PLACE

// Tangent of half a face's angle: a little more than a cube's, so that filters at a face's edge stay inside it.
const float FACE_TANGENT = 1.125;

// The receiver is moved along its normal, Holbert, "Saying Goodbye to Shadow Acne" (2011): by as many texels as its plane's
// height changes from a tap to the farthest of the four texels compared there, and a quarter more; and by a quarter in any
// case, for edges of hollow things.
const float NORMAL_OFFSET_TEXELS = 1.25;
const float LEAST_OFFSET_TEXELS = 0.25;

// A surface seen by the light at a smaller cosine than this is taken to slant no more, which bounds the slope.
const float LEAST_SLANT = 0.01;

// A place in a shadow map.
struct ShadowPlace {
    vec2 uv;
    float layer; // of the lamp's six, 0 for the sun
    float depth;
    vec2 slope;  // change of depth per uv on the plane through the point
    vec2 back;   // from uv to where the point would be if it had not been moved; of the sun's map
    vec2 spread; // radius of the light's disc in uv, seen through a hole, per depth between hole and point
};

// Of a point at `q` from the lamp, `n` its normal towards the lamp. Faces are +X, -X, +Y, -Y, +Z, -Z; on each, u runs along
// the axis after its own (against it where the face is positive), v against the one after that, so that a right-handed
// view sees it upright; `texels` along a face. Depth is near / distance along the face's axis, linear in uv on every plane.
ShadowPlace lamp_place(vec3 q, vec3 n, float near, float radius, float texels)
{
    vec3 a = abs(q);
    vec3 p = q, m = n; // in the face's axes: across, up, along
    float face = 4.0;
    if (a.x >= a.y && a.x >= a.z) {
        p = q.yzx;
        m = n.yzx;
        face = 0.0;
    } else if (a.y >= a.z) {
        p = q.zxy;
        m = n.zxy;
        face = 2.0;
    }
    float texel = 2.0 * FACE_TANGENT * abs(p.z) / texels;
    p += texel * (LEAST_OFFSET_TEXELS + NORMAL_OFFSET_TEXELS * (abs(m.x) + abs(m.y))) * m;
    float along = max(abs(p.z), 1e-20);
    vec2 sides = vec2(p.z < 0.0 ? 1.0 : -1.0, -1.0);
    const float UV = 0.5 / FACE_TANGENT;
    ShadowPlace place;
    place.uv = vec2(0.5) + UV * sides * p.xy / along;
    place.layer = face + (p.z < 0.0 ? 1.0 : 0.0);
    place.depth = near / along;
    float height = min(dot(m, p), -LEAST_SLANT * along);
    place.slope = near / (UV * height) * sides * m.xy;
    place.back = vec2(0.0);
    place.spread = vec2(UV * radius / near);
    return place;
}

// Of a point in the sun's map, `p` by u, v and depth; `gradient`: the normal of the point's plane, each number in metres of the map's
// size along its axis, the last one towards the sun; `size2`: squares of the sizes.
ShadowPlace sun_place(vec3 p, vec3 gradient, vec3 size2, vec2 spread, float texels)
{
    // Metres that the receiver is moved along its normal, as for lamps: texels are as large everywhere.
    float offset = (LEAST_OFFSET_TEXELS * sqrt(max(size2.x, size2.y)) + NORMAL_OFFSET_TEXELS * (abs(gradient.x) + abs(gradient.y))) / texels;
    vec3 moved = offset * gradient / size2;
    p += moved;
    ShadowPlace place;
    place.back = -moved.xy;
    place.uv = p.xy;
    place.layer = 0.0;
    place.spread = spread;
    float steepest = max(gradient.z, LEAST_SLANT * length(gradient));
    place.slope = -gradient.xy / steepest;
    place.depth = p.z;
    return place;
}

#endif
