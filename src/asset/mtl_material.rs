//! What the keys of MTL mean: from the Phong and PBR keys of a material to the metallic–roughness model.

use std::collections::HashSet;
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use super::image_source::ImageSource;
use super::material::{
    AlphaUse, Factor, MAX_EMISSION, MAX_IOR, MapDesc, MaterialDesc, NormalsDesc, NormalsKind, Sampling, USUAL_IOR,
    Wrap, f0_from_ior,
};
use super::mtl::{Map, Mtl};
use super::texture::Pick;
use super::{Report, file};

/// Base color of materials without any key for it, and of submeshes without a material.
pub const DEFAULT_GREY: f32 = 0.8;
/// Roughness of such materials.
pub const DEFAULT_ROUGHNESS: f32 = 0.5;
/// Of sheen, for which MTL has no key: Blender's, which writes `Ps`.
const SHEEN_ROUGHNESS: f32 = 0.5;

/// One material for each of `mtls`. A picture that is not there is left out with a warning that names file and key.
///
/// Metallic and roughness are factor times map, the factor 1 where only the map is given. Where neither is, metallic is
/// 0, and roughness comes from the Phong keys: 1 without a highlight (`Ks` 0), else from `Ns` by alpha² = 2/(Ns + 2)
/// (Walter et al. 2007, section 5.2), else 0.5. In Blender's files `Ns` is 1000 (1 − roughness)², and `Ka` is metalness
/// where `illum` is 3. Occlusion is `map_ao`, else `map_Ka`, unless that repeats `map_Kd`, as
/// the Phong model's ambient colour did. Cutouts come from `map_d`, else from alpha of `map_Kd`; a surface with `d` below
/// 1 is blended with what is behind it.
pub fn materials(mtls: &[Mtl], report: &Report) -> Vec<MaterialDesc> {
    let mut interpreter = Interpreter { warned: HashSet::new(), report };
    mtls.iter().map(|mtl| interpreter.material(mtl)).collect()
}

/// What keys of the PBR model do not say.
fn guesses(mtl: &Mtl) -> Vec<String> {
    let mut guesses = Vec::new();
    if mtl.kd.is_none() && mtl.map_kd.is_none() {
        guesses.push(format!("base color {DEFAULT_GREY}: there is no Kd"));
    }
    if mtl.roughness.is_none() && mtl.map_roughness.is_none() {
        let from = match (mtl.ks, mtl.ns) {
            (_, Some(ns)) if mtl.by_blender => format!("from Ns {ns} as Blender writes it"),
            (Some(ks), _) if ks == [0.0; 3] => "because Ks is 0".into(),
            (_, Some(ns)) => format!("from Ns {ns} of the Phong model"),
            _ => "there is no Pr".into(),
        };
        guesses.push(format!("roughness {:.2}: {from}", phong_roughness(mtl)));
    }
    if mtl.metallic.is_none() && mtl.map_metallic.is_none() {
        guesses.push(match blenders_metalness(mtl) {
            Some(metallic) => format!("metalness {metallic}: from Ka as Blender writes it"),
            None => "metalness 0: there is no Pm".into(),
        });
    }
    if let (true, Some(model)) = (is_glass(mtl), mtl.illum) {
        guesses.push(format!("a sheet of glass: Kd is 0, and illum {model} lets light through"));
    }
    guesses
}

/// Of Blender's illumination models one mirrors.
fn blenders_metalness(mtl: &Mtl) -> Option<f32> {
    mtl.ka.filter(|_| mtl.by_blender && mtl.illum == Some(3)).map(|[r, ..]| r)
}

fn phong_roughness(mtl: &Mtl) -> f32 {
    match (mtl.ks, mtl.ns) {
        (_, Some(ns)) if mtl.by_blender => 1.0 - (ns / 1000.0).max(0.0).sqrt(),
        (Some(ks), _) if ks == [0.0; 3] => 1.0,
        (_, Some(ns)) => (2.0 / (ns.max(0.0) + 2.0)).powf(0.25),
        _ => DEFAULT_ROUGHNESS,
    }
}

/// By the index of refraction where that is one on purpose: 1 stands for no refraction at all, and exporters write 1.3 to 1.7 for
/// materials whose highlights are those of 1.5.
fn ior(mtl: &Mtl) -> f32 {
    mtl.ior.filter(|ior| *ior > 1.0 && !(1.3..=1.7).contains(ior)).unwrap_or(USUAL_IOR)
}

/// Illumination models 4 and 9 have glass, 6 and 7 refraction. Some programs write one for anything, but not with a black
/// diffuse colour, and others say by `d` how much is covered.
fn is_glass(mtl: &Mtl) -> bool {
    let is_opaque = mtl.dissolve.is_none_or(|d| d >= 1.0) && mtl.map_d.is_none();
    let is_black = mtl.kd == Some([0.0; 3]) && mtl.map_kd.is_none();
    let is_dielectric = mtl.metallic.unwrap_or(0.0) == 0.0 && mtl.map_metallic.is_none();
    is_opaque && is_black && is_dielectric && matches!(mtl.illum, Some(4 | 6 | 7 | 9))
}

/// The colour of glass. Rhino writes 0 where nothing shines through.
fn transmission(mtl: &Mtl) -> Vec3 {
    mtl.tf.map(Vec3::from).filter(|tf| *tf != Vec3::ZERO).map_or(Vec3::ONE, |tf| tf.clamp(Vec3::ZERO, Vec3::ONE))
}

struct Interpreter<'a> {
    /// Names of pictures that were warned of, by library.
    warned: HashSet<(PathBuf, String)>,
    report: &'a Report,
}

impl Interpreter<'_> {
    fn material(&mut self, mtl: &Mtl) -> MaterialDesc {
        let repeats_colour = |a: &Map| mtl.map_kd.as_ref().is_some_and(|kd| kd.file.eq_ignore_ascii_case(&a.file));
        let ambient = mtl.map_ka.as_ref().filter(|map| !repeats_colour(map));
        let base_color_map = self.map(mtl, mtl.map_kd.as_ref(), Pick::Red);
        let mut mask_map = self.map(mtl, mtl.map_d.as_ref(), Pick::Coverage);
        if let (Some(mask), Some(colour), None) =
            (&mut mask_map, &base_color_map, mtl.map_d.as_ref().and_then(|m| m.pick))
            && mask.image == colour.image
        {
            // A picture that is a mask, too, is so by its alpha alone.
            mask.pick = Pick::Alpha;
        }
        let norm = self.map(mtl, mtl.norm.as_ref(), Pick::Red);
        let bump = if norm.is_some() { None } else { self.map(mtl, mtl.bump.as_ref(), Pick::Red) };
        let strength = mtl.bump.as_ref().map_or(1.0, |map| map.bump_strength);
        let normals = norm.map(|map| NormalsDesc { map, kind: NormalsKind::Vectors(1.0) });
        let occlusion_map = self.map(mtl, mtl.map_ao.as_ref().or(ambient), Pick::Red);
        let roughness_map = self.map(mtl, mtl.map_roughness.as_ref(), Pick::Red);
        let metallic_map = self.map(mtl, mtl.map_metallic.as_ref(), Pick::Red);
        let emissive_map = self.map(mtl, mtl.map_ke.as_ref(), Pick::Red);
        let clearcoat_map = self.map(mtl, mtl.map_clearcoat.as_ref(), Pick::Red);
        let opacity = self.opacity(mtl);
        let mut desc = MaterialDesc {
            base_color: self.base_color(mtl, base_color_map.is_some()),
            opacity,
            metallic: self.metallic(mtl, metallic_map.is_some()),
            roughness: self.roughness(mtl, roughness_map.is_some()),
            dielectric_f0: Vec3::splat(f0_from_ior(ior(mtl))),
            clearcoat: self
                .factor(mtl, ("Pc", mtl.clearcoat), clearcoat_map.is_some(), 0.0)
                .of(clearcoat_map.is_some()),
            clearcoat_roughness: self.factor(mtl, ("Pcr", mtl.clearcoat_roughness), false, 0.0).alone,
            clearcoat_map,
            film: None,
            film_map: None,
            sheen: Vec3::splat(self.factor(mtl, ("Ps", mtl.sheen), false, 0.0).alone),
            sheen_roughness: SHEEN_ROUGHNESS,
            anisotropy: self.anisotropy(mtl),
            emissive: self.emissive(mtl, emissive_map.is_some()),
            base_color_map,
            mask_map,
            normals: normals.or(bump.map(|map| NormalsDesc { map, kind: NormalsKind::Bump(strength) })),
            occlusion_map,
            roughness_map,
            metallic_map,
            emissive_map,
            guesses: guesses(mtl),
            alpha: if opacity < 1.0 { AlphaUse::Blend } else { AlphaUse::Guessed },
            ..MaterialDesc::plain(&mtl.name, Vec3::ZERO, 0.0, 0.0)
        };
        let transmission = transmission(mtl);
        if is_glass(mtl) {
            desc.base_color = Factor::same(transmission);
            desc.transmit(1.0, Vec3::ONE);
            if matches!(mtl.illum, Some(6 | 7)) {
                desc.refract([ior(mtl).min(MAX_IOR), 0.0], transmission, Vec3::ZERO);
            }
        } else if transmission != Vec3::ONE {
            self.report.warn(format!(
                "{}: material {}: Tf: colours what goes through glass alone: illum 4, 6, 7 or 9 with Kd 0 0 0 and without d",
                file::short_name(&mtl.path),
                mtl.name
            ));
        }
        desc
    }

    /// A map whose file is there.
    fn map(&mut self, mtl: &Mtl, map: Option<&Map>, pick: Pick) -> Option<MapDesc> {
        let map = map?;
        let origin = format!("{}:{}: {} {}", file::short_name(&mtl.path), map.line, map.key, map.file);
        let found = file::find(mtl.path.parent().unwrap_or(Path::new("")), &map.file);
        let problem = match &found {
            None => Some("file not found; using the factor alone".to_owned()),
            Some(found) => found.real_name.as_ref().map(|real| format!("found as {real}")),
        };
        // Each name is warned of once.
        if let Some(problem) = problem
            && self.warned.insert((mtl.path.clone(), map.file.clone()))
        {
            self.report.warn(format!("{origin}: {problem}"));
        }
        let (image, pick) = (ImageSource::file(found?.path), map.pick.unwrap_or(pick));
        let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
        let sampling = Sampling { wrap: [wrap; 2], nearest: false };
        Some(MapDesc { image, pick, second_uv: false, sampling, origin })
    }

    fn base_color(&self, mtl: &Mtl, has_map: bool) -> Factor<Vec3> {
        let Some(kd) = mtl.kd.map(Vec3::from_array) else {
            return Factor { with_map: Vec3::ONE, alone: Vec3::splat(DEFAULT_GREY) };
        };
        let clamped = kd.clamp(Vec3::ZERO, Vec3::ONE);
        if clamped != kd {
            self.warn(mtl, &format!("Kd {} {} {} is not between 0 and 1; clamped", kd.x, kd.y, kd.z));
        }
        // Some exporters write 0 with a map; the product would be black.
        let with_map = if kd == Vec3::ZERO { Vec3::ONE } else { clamped };
        if has_map && kd == Vec3::ZERO {
            self.warn(mtl, "Kd 0 with map_Kd; taken as 1");
        }
        Factor { with_map, alone: clamped }
    }

    fn emissive(&self, mtl: &Mtl, has_map: bool) -> Factor<Vec3> {
        let ke = Vec3::from_array(mtl.ke.unwrap_or([0.0; 3]));
        let clamped = ke.clamp(Vec3::ZERO, Vec3::splat(MAX_EMISSION));
        if clamped != ke {
            self.warn(mtl, &format!("Ke {} {} {} is not between 0 and {MAX_EMISSION:e}; clamped", ke.x, ke.y, ke.z));
        }
        if has_map && mtl.ke == Some([0.0; 3]) {
            self.warn(mtl, "Ke 0 with map_Ke; taken as 1");
        }
        Factor { with_map: if clamped == Vec3::ZERO { Vec3::ONE } else { clamped }, alone: clamped }
    }

    fn opacity(&self, mtl: &Mtl) -> f32 {
        match mtl.dissolve {
            Some(0.0) => {
                self.warn(mtl, "d 0 would be invisible; drawn opaque");
                1.0
            }
            Some(d) if !(0.0..=1.0).contains(&d) => {
                self.warn(mtl, &format!("d {d} is not between 0 and 1; clamped"));
                if d < 0.0 { 1.0 } else { d.min(1.0) }
            }
            d => d.unwrap_or(1.0),
        }
    }

    fn metallic(&self, mtl: &Mtl, has_map: bool) -> Factor<f32> {
        self.factor(mtl, ("Pm", mtl.metallic), has_map, blenders_metalness(mtl).unwrap_or(0.0))
    }

    fn roughness(&self, mtl: &Mtl, has_map: bool) -> Factor<f32> {
        self.factor(mtl, ("Pr", mtl.roughness), has_map, phong_roughness(mtl))
    }

    /// Along tangent and bitangent.
    fn anisotropy(&self, mtl: &Mtl) -> Vec2 {
        let turns = mtl.anisotropy_rotation.filter(|turns| turns.is_finite()).unwrap_or(0.0);
        self.factor(mtl, ("aniso", mtl.anisotropy), false, 0.0).alone * Vec2::from_angle(TAU * turns)
    }

    /// What a key says, in 0 to 1; where it is absent `otherwise`, or with a map 1.
    fn factor(&self, mtl: &Mtl, (key, value): (&str, Option<f32>), has_map: bool, otherwise: f32) -> Factor<f32> {
        let Some(value) = value else { return Factor { with_map: 1.0, alone: otherwise.clamp(0.0, 1.0) } };
        let alone = value.clamp(0.0, 1.0);
        if alone != value {
            self.warn(mtl, &format!("{key} {value} is not between 0 and 1; clamped"));
        }
        // Some exporters write 0 with a map; the product would be 0 everywhere.
        if has_map && value == 0.0 {
            self.warn(mtl, &format!("{key} 0 with map_{key}; taken as 1"));
        }
        Factor { with_map: if value == 0.0 { 1.0 } else { alone }, alone }
    }

    fn warn(&self, mtl: &Mtl, problem: &str) {
        self.report.warn(format!("{}: material {}: {problem}", file::short_name(&mtl.path), mtl.name));
    }
}
