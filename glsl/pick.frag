// Writes which material is seen; 0 is left for nothing.
#version 460

layout(location = 3) flat in uint material_index;

layout(location = 0) out uint picked;

void main()
{
    picked = material_index + 1u;
}
