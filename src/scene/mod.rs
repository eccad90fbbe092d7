//! Scenes: their contents as plain data, loading, and what can be known of them before they are drawn.

pub mod atlas;
mod body_map;
pub mod camera_path;
pub mod cluster;
pub mod bvh;
mod contents;
mod caps;
mod culling_bounds;
mod groups;
pub mod darkness;
pub mod description;
pub mod description_text;
mod floor;
pub mod lightmap_texels;
pub mod load;
mod maps;
pub mod material;
pub mod mesh;
mod model_lights;
pub mod needs;
pub mod places;
pub mod probes;
mod random_paths;
pub mod sphere_lights;
mod refraction;
mod things;
pub mod staging;
pub mod surroundings;
pub mod tangent;

pub use contents::{
    Camera, Environment, GeometryView, Instance, Lookup, MAPS, Material, MaterialSource, PointLight, Probe, Scene,
};
pub use floor::floor_under;
pub use load::{LoadOptions, is_scene, load};
pub use mesh::{Bounds, Mesh, Vertex};
pub use needs::{MaterialFeatures, Model, SceneFeatures};
