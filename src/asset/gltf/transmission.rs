//! `KHR_materials_transmission`, `…_volume` and `…_dispersion`: light that goes through surfaces, and what bodies do to it.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::document::TextureInfo;
use crate::asset::material::{MapDesc, Wrap};
use crate::asset::mesh::Submesh;
use crate::asset::texture::Channel;

pub const NAME: &str = "KHR_materials_transmission";
pub const VOLUME: &str = "KHR_materials_volume";
pub const DISPERSION: &str = "KHR_materials_dispersion";
/// Below that of which red light would not be bent at all.
pub const MAX_DISPERSION: f32 = 39.0;

/// What stands for an attenuation color of 0.
pub(super) const MIN_ATTENUATION: f32 = 1e-6;
/// Of a body that nothing is seen through, 1/m.
const MAX_ABSORPTION: f32 = 1e6;

/// What a surface lets through.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Transmission {
    pub transmission_factor: f32,
    pub transmission_texture: Option<TextureInfo>,
}

/// How far a body of it splits light into colours.
#[derive(Default, Deserialize)]
#[serde(default)]
pub struct Dispersion {
    /// 20 over Abbe's number.
    pub dispersion: f32,
}

/// What a closed body of it does to light on its way through.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Volume {
    pub thickness_factor: f32,
    pub attenuation_distance: f32,
    pub attenuation_color: [f32; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_distance: f32::INFINITY, attenuation_color: [1.0; 3] }
    }
}

/// A map of what a surface lets through, for telling apart the triangles that are sheets.
pub struct SheetMap {
    channel: Channel,
    second_uv: bool,
    wrap: [Wrap; 2],
}

/// Texels from which on more goes through than not.
const HALF: u8 = 128;
/// Steps along a triangle's edges between which the map is looked up.
const STEPS: u8 = 8;

impl SheetMap {
    /// The map, and the mean of what goes through where it is more than half; `None` if it is so nowhere.
    pub fn new(channel: Channel, map: &MapDesc) -> Option<(Self, f32)> {
        let (sum, count) = channel
            .values
            .iter()
            .filter(|value| **value >= HALF)
            .fold((0u64, 0u64), |(sum, count), value| (sum + u64::from(*value), count + 1));
        let share = sum as f32 / (255 * count.max(1)) as f32;
        let map = Self { channel, second_uv: map.second_uv, wrap: map.sampling.wrap };
        (count > 0).then_some((map, share))
    }

    /// Coordinates as of vertices, v upwards.
    fn is_sheet_at(&self, uv: Vec2) -> bool {
        let texel = |at: f32, side: u32, wrap: Wrap| {
            let at = match wrap {
                Wrap::Repeat => at.rem_euclid(1.0),
                Wrap::Mirror => 1.0 - (at.rem_euclid(2.0) - 1.0).abs(),
                Wrap::Clamp => at,
            };
            ((at * side as f32).max(0.0) as u32).min(side - 1)
        };
        let [x, y] =
            [texel(uv.x, self.channel.width, self.wrap[0]), texel(1.0 - uv.y, self.channel.height, self.wrap[1])];
        self.channel.values[(y * self.channel.width + x) as usize] >= HALF
    }

    /// Whether a triangle lets light through on more than half of it.
    fn is_sheet(&self, [a, b, c]: [Vec2; 3]) -> bool {
        let (mut inside, mut all) = (0, 0);
        for i in 0..STEPS {
            for j in 0..STEPS - i {
                let [u, v] = [i, j].map(|step| (f32::from(step) + 1.0 / 3.0) / f32::from(STEPS));
                inside += u32::from(self.is_sheet_at(a + u * (b - a) + v * (c - a)));
                all += 1;
            }
        }
        2 * inside > all
    }

    /// The triangles through which less goes, and the others, which get the material `sheet`.
    pub fn split(&self, submesh: Submesh, sheet: usize) -> [Submesh; 2] {
        let empty = |material| Submesh {
            name: submesh.name.clone(),
            material,
            has_uvs: submesh.has_uvs,
            corners: Vec::new(),
            smoothing: Vec::new(),
            extras: Vec::new(),
        };
        let mut parts = [empty(submesh.material), empty(Some(sheet))];
        for (triangle, corners) in submesh.corners.as_chunks::<3>().0.iter().enumerate() {
            let extras = submesh.extras.get(3 * triangle..3 * triangle + 3);
            let uvs = match extras {
                Some([a, b, c]) if self.second_uv => [a.uv1, b.uv1, c.uv1],
                _ => corners.map(|corner| corner.uv),
            };
            let part = &mut parts[usize::from(self.is_sheet(uvs))];
            part.corners.extend(corners);
            part.extras.extend(extras.into_iter().flatten());
            part.smoothing.extend(submesh.smoothing.get(triangle));
        }
        parts
    }
}

impl Volume {
    /// By which light is multiplied at each of the two surfaces that it goes through, by Beer and Lambert's law.
    pub fn per_surface(&self) -> Vec3 {
        let distances = self.thickness_factor.max(0.0) / self.attenuation_distance.max(f32::MIN_POSITIVE);
        let color = Vec3::from(self.attenuation_color).clamp(Vec3::ZERO, Vec3::ONE);
        color.powf(0.5 * distances.min(f32::MAX))
    }

    /// The same law's coefficient, 1/m.
    pub fn absorption(&self) -> Vec3 {
        let color = Vec3::from(self.attenuation_color).clamp(Vec3::splat(MIN_ATTENUATION), Vec3::ONE);
        (-color.map(f32::ln) / self.attenuation_distance.max(f32::MIN_POSITIVE)).min(Vec3::splat(MAX_ABSORPTION))
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec4;

    use super::*;
    use crate::asset::image_source::ImageSource;
    use crate::asset::material::Sampling;
    use crate::asset::mesh::{Corner, CornerExtra};
    use crate::asset::texture::Pick;

    #[test]
    fn a_mesh_is_split_by_the_coordinates_of_the_map() {
        let wrap = [Wrap::Mirror, Wrap::Clamp];
        let map = MapDesc {
            image: ImageSource::file("a".into()),
            pick: Pick::Red,
            second_uv: true,
            sampling: Sampling { wrap, ..Sampling::default() },
            origin: String::new(),
        };
        let (map, share) =
            SheetMap::new(Channel { width: 2, height: 1, values: vec![255, 0] }, &map).expect("it lets through");
        assert_eq!(share, 1.0);
        let corner = Corner { position: Vec3::ZERO, normal: Vec3::Y, uv: Vec2::ZERO };
        let extra = |u: f32, v: f32| CornerExtra { uv1: Vec2::new(u, v), colour: Vec4::ONE, tangent: Vec4::ZERO };
        // In the clear half, in the other one, and mirrored about u = 1 in the clear one again, which clamps v.
        let places = [[0.0, 0.4], [0.6, 0.9], [1.6, 1.9]];
        let triangle = |[a, b]: [f32; 2]| [extra(a, 0.0), extra(b, 7.0), extra(a, -7.0)];
        let mesh = Submesh {
            name: "pane".into(),
            material: Some(3),
            has_uvs: true,
            corners: vec![corner; 9],
            smoothing: vec![1, 2, 3],
            extras: places.into_iter().flat_map(triangle).collect(),
        };
        let [solid, sheet] = map.split(mesh.clone(), 4);
        assert_eq!((solid.material, solid.smoothing, &solid.extras[..]), (Some(3), vec![2], &mesh.extras[3..6]));
        assert_eq!((sheet.material, sheet.smoothing, sheet.corners.len()), (Some(4), vec![1, 3], 6));
        assert_eq!(sheet.extras, [&mesh.extras[..3], &mesh.extras[6..]].concat());
    }
}
