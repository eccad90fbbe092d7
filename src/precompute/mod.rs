//! Panorama to cube pyramid, irradiance, specular levels; BRDF table.
