// What the reference traces.
#ifndef TRANSPORT_GLSL
#define TRANSPORT_GLSL

// The order of render::Transport.
layout(constant_id = 16) const uint TRANSPORT = 0;
const uint TRANSPORT_NONE = 0;   // nothing blocks light or gives it back
const uint TRANSPORT_DIRECT = 1; // lamps and the sun cast shadows
const uint TRANSPORT_ALL = 2;

#endif
