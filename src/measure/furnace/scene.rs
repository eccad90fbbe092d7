//! Scenes for the white furnace: surfaces under even light, drawn as if from infinitely far.

use glam::{Mat4, Vec3};

use super::super::bench::Bench;
use crate::Result;
use crate::asset::Panorama;
use crate::context::Context;
use crate::render::{Eye, Output, RenderSettings};
use crate::scene::{Bounds, Environment, Instance, Material, Mesh, Scene, Vertex};

/// Surfaces and directions: columns of roughnesses and, within each, views; a line for each material.
pub struct Grid {
    /// From 0 to 1.
    pub roughnesses: usize,
    /// n·v from 1 / views to 1.
    pub views: usize,
    /// Base colour, the same in all channels, and metalness.
    pub lines: Vec<[f32; 2]>,
    /// Pixels along a patch's side.
    pub patch: usize,
}

/// The i-th of so many numbers from 0 to 1.
pub fn share(i: usize, count: usize) -> f32 {
    i as f32 / (count - 1) as f32
}

impl Grid {
    pub fn columns(&self) -> usize {
        self.roughnesses * self.views
    }

    /// Roughness and n·v of a column.
    pub fn at(&self, column: usize) -> [f32; 2] {
        [share(column / self.views, self.roughnesses), (column % self.views + 1) as f32 / self.views as f32]
    }

    /// The picture's size.
    pub fn pixels(&self) -> [u32; 2] {
        [self.columns(), self.lines.len()].map(|s| (s * self.patch) as u32)
    }

    /// The values of a patch's pixels but for those at its edges, from all of the picture's.
    pub fn patch<'a>(&self, picture: &'a [Vec3], at: [usize; 2]) -> impl Iterator<Item = f64> + Clone + use<'a> {
        let ([column, line], width, inner) = (at, self.columns() * self.patch, 1..self.patch - 1);
        let corner = line * self.patch * width + column * self.patch;
        // White on white: all channels are alike.
        inner.clone().flat_map(move |y| inner.clone().map(move |x| f64::from(picture[corner + y * width + x].x)))
    }

    /// A square of side 1 for each surface and view, line below line; they face +Z, and their normals are tilted up.
    pub fn scene(&self) -> Scene {
        let (mut meshes, mut materials) = (Vec::new(), Vec::new());
        for (line, [color, metallic]) in self.lines.iter().enumerate() {
            for first in (0..self.columns()).step_by(self.views) {
                let (mut vertices, mut indices) = (Vec::new(), Vec::new());
                for column in first..first + self.views {
                    let [_, n_dot_v] = self.at(column);
                    let normal = [0.0, (1.0 - n_dot_v * n_dot_v).sqrt(), n_dot_v];
                    let corner = vertices.len() as u32;
                    for [x, y] in [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
                        let position = [column as f32 + x, -(line as f32 + y), 0.0];
                        let tangent = [1.0, 0.0, 0.0, 1.0];
                        vertices.push(Vertex { position, normal, tangent, ..Vertex::default() });
                    }
                    indices.extend([0, 1, 2, 0, 2, 3].map(|i| corner + i));
                }
                let bounds = Bounds::of(vertices.iter().map(|v| v.position.into()));
                meshes.push(Mesh { name: "patches".into(), vertices, indices, material: materials.len(), bounds });
                materials.push(Material::plain("patch", Vec3::splat(*color), *metallic, self.at(first)[0]));
            }
        }
        let instances = (0..meshes.len()).map(|mesh| Instance { mesh, world_from_local: Mat4::IDENTITY }).collect();
        in_furnace(meshes, instances, materials)
    }
}

/// A scene under even light of radiance 1.
pub fn in_furnace(meshes: Vec<Mesh>, instances: Vec<Instance>, materials: Vec<Material>) -> Scene {
    Scene {
        meshes,
        instances,
        sources: Vec::new(),
        materials,
        textures: vec![],
        lights: vec![],
        cameras: vec![],
        environment: Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 },
        probes: vec![],
        exposure_ev: 0.0,
    }
}

/// What lies between the origin and (width, −height), seen from so far along +Z that all of it is seen from one direction.
pub fn bench(context: &Context, scene: &Scene, size: [u32; 2], settings: RenderSettings) -> Result<Bench> {
    let bounds = scene.bounds();
    let [width, height] = [bounds.max.x.ceil(), -bounds.min.y.floor()];
    let (middle, away) = (Vec3::new(0.5 * width, -0.5 * height, 0.0), 200.0 * width);
    let fov = 2.0 * (0.5 * height / away).atan().to_degrees();
    let eye = Eye::looking(middle + away * Vec3::Z, middle, fov, size[0] as f32 / size[1] as f32);
    Bench::new(context, scene, RenderSettings { output: Output::Linear, ..settings }, size, vec![eye])
}
