// Boxes around probes: parallax and influence; twin of src/reference/probe.rs; no bindings.
#ifndef PROBE_BOX_GLSL
#define PROBE_BOX_GLSL

struct Probe {
    vec3 position;  // metres, in the models' space, as the boxes
    vec3 low, high; // what was captured is taken to lie on this box,
    vec3 reach_low, reach_high; // and mirror images show it in this one
    float border;   // metres outside of which its influence ends
};

// Where a ray from p, towards d of any length, leaves the box: Lagarde and Zanuttini, "Local Image-based Lighting With
// Parallax-corrected Cubemaps" (2012). From outside of the box the ray begins at its nearest point.
vec3 box_exit(vec3 p, vec3 d, vec3 low, vec3 high)
{
    vec3 start = clamp(p, low, high), least = vec3(1e-18);
    bvec3 forwards = greaterThanEqual(d, vec3(0.0));
    vec3 inverse = 1.0 / mix(min(d, -least), max(d, least), forwards);
    vec3 t = (mix(low, high, forwards) - start) * inverse;
    return start + min(t.x, min(t.y, t.z)) * d;
}

// What lies nearer than this part of the way to the box is no part of the image that is taken to lie on it.
const float BEFORE_WALL = 0.75;

// 1 where mirror images show it, 0 from the border on, with an even slope at both ends.
float probe_weight(vec3 p, Probe probe)
{
    vec3 outside = max(max(probe.reach_low - p, p - probe.reach_high), vec3(0.0));
    float part = min(length(outside) / probe.border, 1.0);
    return 1.0 - part * part * (3.0 - 2.0 * part);
}

// Whether what a ray along a unit direction meets after t metres is part of the image that is taken to lie on the probe's box.
bool is_in_image(vec3 p, vec3 d, float t, Probe probe)
{
    return t > BEFORE_WALL * distance(p, box_exit(p, d, probe.low, probe.high));
}

#endif
