// What rays may meet or be sent to in a scene, so that its shaders have no code for anything else: software renderers run all
// code that there is, and compile it first.
#ifndef RAY_FEATURES_GLSL
#define RAY_FEATURES_GLSL

layout(constant_id = 24) const uint RAY_FEATURES = 0xffffffffu;
// Bits of it, those of `ray_feature` in src/render/shared.rs.
const uint RAYS_HOLES = 1;       // alpha-tested or blended surfaces
const uint RAYS_EMITTERS = 2;    // surfaces that shine
const uint RAYS_RELAYS = 4;      // of a lightmap: lamps or surfaces that shine near to other surfaces
const uint RAYS_GLOSSY = 8;      // smooth metal
const uint RAYS_EXTRAS = 16;     // colours of vertices or second texture coordinates
const uint RAYS_SKY_RELAYS = 32; // of paths: light followed from the panorama
const uint RAYS_TINTS = 64;      // sheets that change the colour of what goes through
const uint RAYS_CLEARCOAT = 128; // clear coats
const uint RAYS_REFRACTS = 256;  // bodies that bend light
const uint RAYS_SHEEN = 512;    // cloth with sheen
const uint RAYS_FILM = 32768;    // thin films
const uint RAYS_ANISOTROPY = 65536; // stretched highlights
const uint RAYS_DIFFUSE_TRANSMISSION = 131072; // sheets that light diffuses through
const uint RAYS_MAPS = 1024;      // shifted by the number of a map: some material has it

// Of these, those that shaders for core materials know nothing of.
#ifdef CORE_MATERIALS
const uint MET_BY_NONE = RAYS_CLEARCOAT | RAYS_REFRACTS | RAYS_SHEEN | RAYS_ANISOTROPY | RAYS_FILM
    | RAYS_DIFFUSE_TRANSMISSION | RAYS_MAPS << 4;
#else
const uint MET_BY_NONE = 0;
#endif

bool rays_have(uint feature)
{
    return (feature & ~MET_BY_NONE) != 0u && (RAY_FEATURES & feature) != 0u;
}

#endif
