//! The texture sets we make ourselves: albedo, normal (OpenGL +Y), metallic, roughness, ambient occlusion; all tileable.

mod bricks;
mod gold;
pub mod map;
mod noise;
mod plaster;
mod tiles;
mod wood;

use std::error::Error;

use glam::{Vec2, Vec3};

use map::Map;

/// What a material is at one point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surface {
    /// Metres above the lowest plane.
    pub height: f32,
    /// Linear RGB.
    pub albedo: Vec3,
    pub metallic: f32,
    /// What a roughness texture holds: alpha = roughness².
    pub roughness: f32,
}

/// A material that can be asked at every point of its unit square.
pub struct Set {
    /// Folder name.
    pub name: &'static str,
    /// Pixels along an edge.
    size: usize,
    /// What the unit square covers.
    edge_metres: f32,
    /// `at(uv)`: u right, v down, both 0..1 and periodic.
    at: fn(Vec2) -> Surface,
}

/// One encoded map.
pub struct MapFile {
    pub file: &'static str,
    pub jpeg: Vec<u8>,
}

/// Every set, in a fixed order.
pub fn sets() -> [Set; 5] {
    [
        Set { name: "floor-tiles", size: 1024, edge_metres: 0.6, at: tiles::at },
        Set { name: "oxidised-gold", size: 1024, edge_metres: 0.18, at: gold::at },
        Set { name: "old-bricks", size: 1024, edge_metres: 0.5, at: bricks::at },
        Set { name: "wood", size: 512, edge_metres: 1.25, at: wood::at },
        Set { name: "plaster", size: 512, edge_metres: 2.0, at: plaster::at },
    ]
}

impl Set {
    /// Renders and encodes the five maps.
    pub fn maps(&self) -> Result<Vec<MapFile>, Box<dyn Error>> {
        let surface = Map::new(self.size, self.at);
        let height = surface.each(|s| s.height);
        let pixel_metres = self.edge_metres / self.size as f32;
        let normal = height.normals(pixel_metres);
        let occlusion = height.occlusion(pixel_metres);
        let file = |file, jpeg| MapFile { file, jpeg };
        Ok(vec![
            file("albedo.jpg", surface.each(|s| map::srgb(s.albedo)).rgb_jpeg(90)?),
            file("normal.jpg", normal.each(|n| n * 0.5 + 0.5).rgb_jpeg(90)?),
            file("metallic.jpg", surface.each(|s| s.metallic).grey_jpeg(90)?),
            file("roughness.jpg", surface.each(|s| s.roughness).grey_jpeg(90)?),
            file("ao.jpg", occlusion.grey_jpeg(90)?),
        ])
    }
}
