//! What a command line says of a scene: its light, its camera, a floor.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use glam::{Vec2, Vec3};

use super::description::MAX_EXPOSURE;
use super::mesh::Bounds;
use super::{Camera, Instance, Material, Scene, tangent};
use crate::asset::mesh::{Corner, Submesh};
use crate::{Error, Result};

const FOV_DEGREES: f32 = 45.0;
/// Half a side of the floor, in radii of the models.
const FLOOR: f32 = 4.0;
/// Its base colour, and its roughness.
const FLOOR_MATERIAL: (f32, f32) = (0.4, 0.8);

/// What takes the place of a description's keys, for models that have none.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct Staging {
    /// A panorama to light the scene by, .hdr or .exr; that of the scene, or one of the program's, if left out.
    #[arg(long, value_name = "FILE")]
    pub panorama: Option<PathBuf>,
    #[command(flatten)]
    pub stage: Stage,
    /// Write a scene description that gives what these flags give, and is seen by the same camera.
    #[arg(long, value_name = "FILE")]
    pub write_scene: Option<PathBuf>,
}

/// What a command line says of a loaded scene.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Exposure in stops.
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub exposure: Option<f32>,
    /// Turn of the panorama about the axis that points up, in degrees, counter-clockwise seen from above.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = parse_finite)]
    pub rotation: Option<f32>,
    /// One of the scene's cameras; or a view of its middle, from an angle to the right of +Z and one upwards, in degrees, and
    /// from so many metres away. The first camera if left out, or without any a view of all.
    #[arg(long, value_name = "NAME|YAW,PITCH[,DISTANCE]", allow_hyphen_values = true)]
    pub camera: Option<String>,
    /// Put a grey floor under the models.
    #[arg(long)]
    pub floor: bool,
}

/// A view of a point from around it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Orbit {
    /// Degrees; 0 is +Z, 90 is +X.
    yaw: f32,
    /// Degrees above the horizon, less than 90 in both directions.
    pitch: f32,
    /// Metres; all is seen if left out.
    distance: Option<f32>,
}

impl FromStr for Orbit {
    type Err = ();

    fn from_str(text: &str) -> std::result::Result<Self, ()> {
        let number = |word: &str| word.trim().parse().ok().filter(|v: &f32| v.is_finite()).ok_or(());
        let numbers = text.split(',').map(number).collect::<std::result::Result<Vec<_>, _>>()?;
        let (yaw, pitch, distance) = match numbers[..] {
            [yaw, pitch] => (yaw, pitch, None),
            [yaw, pitch, distance] if distance > 0.0 => (yaw, pitch, Some(distance)),
            _ => return Err(()),
        };
        if pitch.abs() < 90.0 { Ok(Self { yaw, pitch, distance }) } else { Err(()) }
    }
}

impl Orbit {
    fn camera(self, bounds: Bounds) -> Camera {
        let (target, radius) =
            if bounds.radius() > 0.0 { (bounds.centre(), bounds.radius()) } else { (Vec3::ZERO, 1.0) };
        let distance = self.distance.unwrap_or(radius / (FOV_DEGREES.to_radians() * 0.5).sin());
        let ((sin, cos), (up, level)) = (self.yaw.to_radians().sin_cos(), self.pitch.to_radians().sin_cos());
        let position = target + Vec3::new(sin * level, up, cos * level) * distance;
        Camera { name: "orbit".into(), position, target, vertical_fov_degrees: FOV_DEGREES }
    }
}

impl Stage {
    /// Puts a loaded scene on stage; its environment has been chosen before. The camera becomes the first. `has_floor`:
    /// whether there is a floor in any case.
    ///
    /// # Errors
    /// [`Error::UnknownName`] for a camera that there is not.
    pub fn apply(&self, scene: &mut Scene, has_floor: bool) -> Result<()> {
        scene.exposure_ev = self.exposure.unwrap_or(scene.exposure_ev);
        if let Some(camera) = &self.camera {
            let camera = find_camera(scene, camera)?;
            scene.cameras.insert(0, camera);
        }
        if self.floor || has_floor {
            add_floor(scene);
        }
        Ok(())
    }
}

/// Takes the camera of a name out of the scene, or makes one of an orbit.
fn find_camera(scene: &mut Scene, text: &str) -> Result<Camera> {
    if let Some(index) = scene.cameras.iter().position(|camera| camera.name == text) {
        return Ok(scene.cameras.remove(index));
    }
    let orbit: std::result::Result<Orbit, ()> = text.parse();
    orbit.map(|orbit| orbit.camera(scene.bounds())).map_err(|()| {
        let all = scene.cameras.iter().map(|camera| camera.name.clone());
        let known = all.chain(["YAW,PITCH[,DISTANCE]".into()]).collect();
        Error::UnknownName { what: "camera", name: text.into(), known }
    })
}

/// A square under everything.
fn add_floor(scene: &mut Scene) {
    let bounds = scene.bounds();
    let (centre, reach) = (bounds.centre(), FLOOR * bounds.radius());
    if bounds == Bounds::EMPTY || reach <= 0.0 {
        return;
    }
    let corner = |x: f32, z: f32| Corner {
        position: Vec3::new(centre.x + x * reach, bounds.min.y, centre.z + z * reach),
        normal: Vec3::Y,
        uv: Vec2::ZERO,
    };
    let [a, b, c, d] = [corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)];
    let corners = vec![a, b, c, a, c, d];
    let submesh = Submesh {
        name: "floor".into(),
        material: None,
        has_uvs: false,
        corners,
        smoothing: Vec::new(),
        extras: Vec::new(),
    };
    let (grey, roughness) = FLOOR_MATERIAL;
    scene.instances.push(Instance { mesh: scene.meshes.len(), world_from_local: glam::Mat4::IDENTITY });
    scene.meshes.push(tangent::mesh(&submesh, scene.materials.len()));
    scene.materials.push(Material::plain("floor", Vec3::splat(grey), 0.0, roughness));
}

fn parse_finite(text: &str) -> std::result::Result<f32, String> {
    text.parse().ok().filter(|number: &f32| number.is_finite()).ok_or_else(|| "a number".into())
}

fn parse_exposure(text: &str) -> std::result::Result<f32, String> {
    let number = text.parse().ok().filter(|number: &f32| number.abs() <= MAX_EXPOSURE);
    number.ok_or_else(|| format!("a number from -{MAX_EXPOSURE} to {MAX_EXPOSURE}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Report;
    use crate::scene::{LoadOptions, load};

    /// A unit square that stands on y = 2, with two cameras or none.
    fn loaded(cameras: &str, staging: Staging) -> Result<Scene> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.obj"), "v 0 2 0\nv 1 2 0\nv 1 3 0\nv 0 3 0\nf 1 2 3 4\n").unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, format!("exposure_ev = 1\n[[model]]\nfile = \"a.obj\"\n{cameras}")).unwrap();
        load(&path, &LoadOptions { staging, ..LoadOptions::default() }, &Report::silent())
    }

    fn staged(stage: Stage) -> Staging {
        Staging { stage, ..Staging::default() }
    }

    fn camera(name: &str) -> Staging {
        staged(Stage { camera: Some(name.into()), ..Stage::default() })
    }

    const TWO: &str = "[[camera]]\nname = \"a\"\nposition = [0, 0, 5]\ntarget = [0, 0, 0]\n\
        [[camera]]\nname = \"9,9\"\nposition = [0, 5, 5]\ntarget = [0, 0, 0]\n";

    #[test]
    fn a_camera_comes_first_by_name_or_goes_around() {
        let names = |scene: Scene| scene.cameras.into_iter().map(|camera| camera.name).collect::<Vec<_>>();
        assert_eq!(names(loaded(TWO, Staging::default()).unwrap()), ["a", "9,9"]);
        assert_eq!(names(loaded(TWO, camera("9,9")).unwrap()), ["9,9", "a"]);
        assert_eq!(names(loaded(TWO, camera("90,0")).unwrap()), ["orbit", "a", "9,9"]);
        let side = loaded("", camera("90,0,3")).unwrap().cameras.remove(0);
        assert!((side.position - Vec3::new(3.5, 2.5, 0.0)).length() < 1e-5, "{side:?}");
        let above = loaded("", camera("0,-45")).unwrap().cameras.remove(0);
        assert!(above.position.y < 2.0 && above.target == Vec3::new(0.5, 2.5, 0.0), "{above:?}");
        for wrong in ["b", "1", "1,90", "1,2,0", "1,2,3,4", "nan,1"] {
            let error = loaded(TWO, camera(wrong)).expect_err("no such camera");
            assert!(error.to_string().contains("there are: a, 9,9, YAW,PITCH[,DISTANCE]"), "{error}");
        }
    }

    #[test]
    fn a_floor_lies_under_everything_and_frames_nothing() {
        let [without, with] =
            [false, true].map(|floor| loaded("", staged(Stage { floor, ..Stage::default() })).unwrap());
        assert_eq!(with.cameras, without.cameras);
        assert_eq!((with.bounds().min.y, with.triangles()), (2.0, without.triangles() + 2));
        assert_eq!(with.materials[with.meshes[1].material].name, "floor");
    }

    #[test]
    fn numbers_take_the_place_of_the_descriptions() {
        let plain = loaded("", Staging::default()).unwrap();
        assert_eq!((plain.exposure_ev, plain.environment.rotation_degrees), (1.0, 0.0));
        let scene =
            loaded("", staged(Stage { exposure: Some(-2.0), rotation: Some(30.0), ..Stage::default() })).unwrap();
        assert_eq!((scene.exposure_ev, scene.environment.rotation_degrees), (-2.0, 30.0));
        assert!(parse_exposure("101").is_err() && parse_exposure("NaN").is_err() && parse_finite("inf").is_err());
    }
}
