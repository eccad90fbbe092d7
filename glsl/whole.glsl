// Fragments of whole surfaces; holes, where there is one sample per pixel.
#include "forward.glsl"

void cut_out(float above)
{
    if (above < 0.0)
        discard;
}
