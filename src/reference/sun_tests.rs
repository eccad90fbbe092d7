//! Suns found in panoramas, computed and shipped.
