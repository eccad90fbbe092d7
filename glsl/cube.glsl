// Directions on cube maps and panoramas, and what their texels cover; twins of src/reference/cube.rs; no bindings.
#ifndef PBR_VR_CUBE
#define PBR_VR_CUBE

#include "math.glsl"

// Unit direction of point st in [0, 1]^2 (from the top left) of a face: the inverse of the Vulkan specification's table
// "Cube map face and coordinate selection"; faces +X, -X, +Y, -Y, +Z, -Z.
vec3 cube_direction(uint face, vec2 st)
{
    vec2 p = 2.0 * st - 1.0;
    vec3 d = face == 0u   ? vec3(1.0, -p.y, -p.x)
             : face == 1u ? vec3(-1.0, -p.y, p.x)
             : face == 2u ? vec3(p.x, 1.0, p.y)
             : face == 3u ? vec3(p.x, -1.0, -p.y)
             : face == 4u ? vec3(p.x, -p.y, 1.0)
                          : vec3(-p.x, -p.y, -1.0);
    return normalize(d);
}

// Point (s, t) and face that direction d (of any length but 0) meets; ties go to z, then y, as the specification has it.
vec3 cube_face(vec3 d)
{
    vec3 a = abs(d);
    vec2 p;
    float major, face;
    if (a.z >= a.x && a.z >= a.y) {
        face = d.z < 0.0 ? 5.0 : 4.0;
        p = vec2(d.z < 0.0 ? -d.x : d.x, -d.y);
        major = a.z;
    } else if (a.y >= a.x) {
        face = d.y < 0.0 ? 3.0 : 2.0;
        p = vec2(d.x, d.y < 0.0 ? -d.z : d.z);
        major = a.y;
    } else {
        face = d.x < 0.0 ? 1.0 : 0.0;
        p = vec2(d.x < 0.0 ? d.z : -d.z, -d.y);
        major = a.x;
    }
    return vec3(0.5 * p / major + 0.5, face);
}

// Solid angle of the triangle with corners a, b, c, given their triple product:
// Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle" (1983), eq. 8.
float triangle_solid_angle(vec3 a, vec3 b, vec3 c, float triple)
{
    float la = length(a), lb = length(b), lc = length(c);
    return 2.0 * atan(triple, la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
}

// Solid angle in sr of texel (x, y) of a face of size^2 texels, exactly. As two triangles, whose triple product is the
// texel's area: a difference of four corner terms loses all digits in f32 on large faces.
float cube_texel_solid_angle(uvec2 texel, uint size)
{
    float side = 2.0 / float(size);
    vec2 lo = vec2(texel) * side - 1.0;
    vec2 hi = vec2(texel + 1u) * side - 1.0;
    vec3 a = vec3(lo, 1.0), b = vec3(hi.x, lo.y, 1.0), c = vec3(hi, 1.0), d = vec3(lo.x, hi.y, 1.0);
    return triangle_solid_angle(a, b, c, side * side) + triangle_solid_angle(a, c, d, side * side);
}

// Panorama coordinates of direction d of any length: u = atan2(z, x) / 2 pi + 1/2, v from the top = 1/2 - asin(y) / pi.
// The latitude is an atan2, which keeps its digits at the poles, where asin loses half of them and is NaN above 1;
// straight up and down, where atan2(0, 0) is undefined, u is 1/2.
vec2 panorama_uv(vec3 d)
{
    float across = length(d.xz);
    float x = across > 0.0 ? d.x : 1.0;
    return vec2(atan(d.z, x) * (0.5 * INV_PI) + 0.5, 0.5 - atan(d.y, max(across, TINY)) * INV_PI);
}

// Unit direction of panorama coordinates (u, v), v from the top.
vec3 panorama_direction(vec2 uv)
{
    float longitude = (uv.x - 0.5) * 2.0 * PI;
    float latitude = (0.5 - uv.y) * PI;
    return vec3(cos(latitude) * cos(longitude), sin(latitude), cos(latitude) * sin(longitude));
}

// Solid angle in sr of a texel in `row` of a panorama of size (width, height), exactly: the zone between two latitudes.
// The difference of their sines is written as a product, and rows below the equator as their mirror images: both keep
// their digits.
float panorama_texel_solid_angle(uint row, uvec2 size)
{
    float step_radians = PI / float(size.y);
    float polar = (float(min(row, size.y - 1u - row)) + 0.5) * step_radians;
    return (4.0 * PI / float(size.x)) * sin(polar) * sin(0.5 * step_radians);
}

// d turned about +Y by an angle given as (cosine, sine), counter-clockwise seen from above.
// A panorama turned by theta is looked up with the direction turned by -theta.
vec3 rotate_y(vec3 d, vec2 cos_sin)
{
    return vec3(cos_sin.x * d.x + cos_sin.y * d.z, d.y, cos_sin.x * d.z - cos_sin.y * d.x);
}

#endif
