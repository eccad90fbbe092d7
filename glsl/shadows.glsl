// How much of lamps' and the sun's light shadow maps let through.
#ifndef PBR_VR_SHADOWS
#define PBR_VR_SHADOWS

#include "ray_features.glsl"
#include "shared.glsl"
#include "shadow_place.glsl"

// Taps of the search for what blocks and of the filter: points of a Vogel disc (Vogel, "A better way to construct the
// sunflower head" (1979)), the same at every pixel, so that nothing flickers in a headset.
const int SEARCH_TAPS = 8;
const int FILTER_TAPS = 16;
const vec2 GOLDEN_TURN = vec2(-0.7373688780783197, 0.6754902942615239); // cos and sin of the golden angle

// The widest filter in uv: what a face has beyond the cube's.
const float WIDEST = 0.5 - 0.5 / FACE_TANGENT;

// A direction turned by the golden angle: from point to point of the disc, without a cosine for each.
vec2 turned(vec2 d)
{
    return vec2(d.x * GOLDEN_TURN.x - d.y * GOLDEN_TURN.y, d.x * GOLDEN_TURN.y + d.y * GOLDEN_TURN.x);
}

// Radius of a disc's point i of so many.
float disc_radius(int i, int count)
{
    return sqrt((float(i) + 0.5) / float(count));
}

// The share of light that passes at one place and its three neighbours.
float shadow_tap(sampler2DArrayShadow shadows, ShadowPlace place, float layer, vec2 offset)
{
    return texture(shadows, vec4(place.uv + offset, layer, place.depth + dot(place.slope, offset)));
}

// By which sheets before a tap's place multiply its light. They are not lit through themselves.
vec3 transmission_tap(sampler2DArray transmission, ShadowPlace place, float layer, vec2 offset)
{
    bool is_tinted = rays_have(RAYS_TINTS) && !TINTS;
    return is_tinted ? textureLod(transmission, vec3(place.uv + offset, layer), 0.0).rgb : vec3(1.0);
}

// Over 3 by 3 texels: four taps between them.
vec3 sharp_shadow(sampler2DArrayShadow shadows, sampler2DArray transmission, ShadowPlace place, float layer)
{
    vec2 half_texel = 0.5 / vec2(textureSize(shadows, 0).xy);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 offset = half_texel * vec2(2 * (i & 1) - 1, 2 * (i >> 1) - 1);
        sum += shadow_tap(shadows, place, layer, offset) * transmission_tap(transmission, place, layer, offset);
    }
    return 0.25 * sum;
}

// A light with a size: Fernando, "Percentage-Closer Soft Shadows" (2005). First the mean depth of what blocks within
// reach, then a filter as wide as the light is, seen through a hole there. Loops end at once where all or nothing blocks;
// a branch would not spare a software renderer the work.
vec3 soft_shadow(sampler2DArrayShadow shadows, sampler2DArray depths, sampler2DArray transmission, ShadowPlace place, float layer)
{
    vec2 texel = 1.0 / vec2(textureSize(shadows, 0).xy);
    vec2 reach = clamp(place.spread * (1.0 - place.depth), texel, vec2(WIDEST));
    float blockers = 0.0, depth = 0.0;
    vec2 d = vec2(1.0, 0.0);
    for (int i = 0; i < SEARCH_TAPS; ++i, d = turned(d)) {
        vec2 offset = reach * (disc_radius(i, SEARCH_TAPS) * d);
        float stored = textureLod(depths, vec3(place.uv + offset, layer), 0.0).r;
        float blocks = float(stored > place.depth + dot(place.slope, offset));
        blockers += blocks;
        depth += blocks * stored;
    }
    vec2 width = clamp(place.spread * (depth / max(blockers, 1.0) - place.depth), 0.5 * texel, vec2(WIDEST));
    vec3 sum = blockers > 0.0 ? vec3(0.0) : transmission_tap(transmission, place, layer, vec2(0.0));
    int taps = blockers > 0.0 && blockers < float(SEARCH_TAPS) ? FILTER_TAPS : 0;
    // At its foot a shadow is looked up where the receiver was moved to: walls would be lit along the edge of a roof without
    // thickness. A wide penumbra would be moved with it.
    vec2 narrow = 0.5 * texel / width, back = (1.0 - max(narrow.x * narrow.x, narrow.y * narrow.y)) * place.back;
    d = vec2(1.0, 0.0);
    for (int i = 0; i < taps; ++i, d = turned(d)) {
        vec2 offset = back + width * (disc_radius(i, FILTER_TAPS) * d);
        sum += shadow_tap(shadows, place, layer, offset) * transmission_tap(transmission, place, layer, offset) / float(FILTER_TAPS);
    }
    return sum;
}

// What reaches a point of a lamp's light; `n`: the triangle's own normal there, on the side that is seen.
vec3 lamp_visibility(PointLight light, vec3 position, vec3 n)
{
    vec3 q = position - light.position;
    ShadowPlace place = lamp_place(q, n, light.shadow_near, light.radius, float(textureSize(lamp_shadows, 0).x));
    float layer = float(light.shadow_layer) + place.layer;
    vec3 lit = vec3(1.0);
    // A lamp without a map lights everything; a surface turned away from it is its own shadow.
    if (LAMP_SHADOWS == LAMP_SHADOWS_SOFT)
        lit = soft_shadow(lamp_shadows, lamp_depths, lamp_transmission, place, layer);
    else
        lit = sharp_shadow(lamp_shadows, lamp_transmission, place, layer);
    return light.shadow_layer < 0 ? vec3(1.0) : dot(n, q) < 0.0 ? lit : vec3(0.0);
}

// A row of the sun's matrix: an axis over the map's size along it.
vec3 frame_row(int i)
{
    mat4 m = frame.sun_shadow.place_from_world;
    return vec3(m[0][i], m[1][i], m[2][i]);
}

// What reaches a point of the sun's light; `n`: the triangle's own normal there, on the side that is seen.
vec3 sun_visibility_at(vec3 position, vec3 n)
{
    vec3 p = (frame.sun_shadow.place_from_world * vec4(position, 1.0)).xyz;
    // A plane's normal in the map's units: by the transposed inverse, the map's axes being perpendicular.
    vec3 size2 = 1.0 / vec3(dot(frame_row(0), frame_row(0)), dot(frame_row(1), frame_row(1)), dot(frame_row(2), frame_row(2)));
    vec3 gradient = (mat3(frame.sun_shadow.place_from_world) * n) * size2;
    ShadowPlace place = sun_place(p, gradient, size2, frame.sun_shadow.spread, float(textureSize(sun_shadows, 0).x));
    vec3 lit = soft_shadow(sun_shadows, sun_depths, sun_transmission, place, 0.0);
    // A surface turned away from it is its own shadow.
    return gradient.z > 0.0 ? lit : vec3(0.0);
}

#endif
