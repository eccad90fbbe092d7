// How light goes on at the boundary of a body that bends it; twin of src/reference/refraction.rs; no bindings.
// Local space: +Z is the normal on the side of v.
#ifndef PBR_VR_REFRACTION
#define PBR_VR_REFRACTION

#include "brdf.glsl"

struct Crossing {
    vec3 l; // where a path from v goes on; the zero vector where it ends
    bool transmitted;
    float weight; // by which light is multiplied, without what the surface absorbs
};

// What a smooth boundary reflects of unpolarized light, by Fresnel's equations. `eta`: the index of refraction on the far side over
// that on the side of incidence.
float fresnel_dielectric(float cosine, float eta)
{
    float square = eta * eta - 1.0 + cosine * cosine; // of eta times the cosine on the far side
    if (square <= 0.0)
        return 1.0; // total reflection
    float far = sqrt(square);
    float across = (cosine - far) / (cosine + far), along = (eta * eta * cosine - far) / (eta * eta * cosine + far);
    return 0.5 * (across * across + along * along);
}

// Smith's masking of GGX microfacets towards a direction with this cosine, either side: Walter et al. (2007), eq. 34.
float masking_ggx(float cosine, float alpha)
{
    float squared = max(cosine * cosine, MIN_COS * MIN_COS);
    return 2.0 / (1.0 + sqrt(1.0 + alpha * alpha * (1.0 / squared - 1.0)));
}

// The half of microfacets with unit normal h that `which`, in [0, 1), takes by its share: mirrored light, or light that goes
// through. For h from `sample_vndf` the weight is the masking of l: Walter et al. (2007), section 5.3, with visible normals.
Crossing cross_boundary(vec3 v, vec3 h, float alpha, float eta, float which)
{
    float vh = max(dot(v, h), 0.0);
    bool transmitted = which >= fresnel_dielectric(vh, eta);
    vec3 l = transmitted ? refract(-v, h, 1.0 / eta) : reflect(-v, h);
    if ((l.z < 0.0) != transmitted)
        return Crossing(vec3(0.0), transmitted, 0.0); // to a side where no light comes from: lost between microfacets
    return Crossing(l, transmitted, masking_ggx(l.z, alpha));
}

// The way of light through a ball, without light that is mirrored inside.
struct BallPath {
    vec3 inside; // unit vector from where v sees the ball to where the path leaves it
    float chord; // the distance in radii
    vec3 l;      // unit vector along which it goes on
};

// Seen along -v where the normal is n; any space, unit vectors. It leaves at the angle at which it enters.
BallPath ball_path(vec3 n, vec3 v, float ior)
{
    float nv = max(dot(n, v), 0.0), over_ior = 1.0 / ior;
    float cosine = sqrt(1.0 - (1.0 - nv * nv) * over_ior * over_ior);
    vec3 inside = (nv * over_ior - cosine) * n - over_ior * v;
    float chord = 2.0 * cosine;
    return BallPath(inside, chord, ior * inside + (nv - ior * cosine) * (n + chord * inside));
}

// By which the directions of parallel paths through a ball turn, squared, where these move by a radius towards its rim, and around the
// axis through its middle: together. nv: cosine of a path to the normal.
float ball_spread2(float nv, float ior)
{
    float b2 = max(1.0 - nv * nv, 1e-6), cosine = max(nv, MIN_COS), inside = sqrt(ior * ior - b2); // ior times its cosine
    float along = 2.0 * (1.0 / cosine - 1.0 / inside);
    // The sine of twice the angle between the path and that inside, over b.
    float b = sqrt(b2), sine = b * (inside - cosine) / ior, across = 2.0 * sine * sqrt(max(1.0 - sine * sine, 0.0)) / b;
    return along * along + across * across;
}

// The variance of directions through a rough ball over that of what its surface mirrors: see the twin.
float ball_variance(float ior)
{
    float entering = (2.0 - ior) * (1.0 - 1.0 / ior);
    return 0.25 * (entering * entering + (ior - 1.0) * (ior - 1.0));
}

#endif
