//! The decisions of `needs` in words: which features are used for a scene, which are not, and why.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::{MaterialFeatures, Metalness, Model, SceneFeatures};
use crate::asset::Panorama;
use crate::reference::energy::VISIBLE;
use crate::scene::{Material, Scene};

/// One decision.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    pub subject: &'static str,
    pub modelled: bool,
    pub why: String,
}

/// All decisions about a scene, as `pbr-vr needs --json` writes them.
#[derive(Clone, Debug, Serialize)]
pub struct Findings {
    pub triangles: usize,
    pub findings: Vec<Finding>,
    pub materials: Vec<MaterialFinding>,
    pub features: SceneFeatures,
}

/// One material's features, by name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialFinding {
    pub name: String,
    pub features: MaterialFeatures,
    pub roughness: [f32; 2],
    pub metallic: [f32; 2],
    pub occludes: bool,
}

/// A small part of the panorama with much of its light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sun {
    /// Unit vector towards it, in the panorama's frame.
    pub towards: [f32; 3],
    /// Its share of all the panorama's light, 0 to 1.
    pub share: f32,
}

/// Half the angle, in degrees, of what counts as the sun: the disc (0.27) and its glare in lenses and filters.
const SUN_DEGREES: f32 = 2.5;
/// Share of all light from which on a source casts a visible shadow.
const SUN_SHARE: f32 = 0.1;

impl Findings {
    /// The decisions about a scene.
    pub fn of(scene: &Scene) -> Self {
        let features = SceneFeatures::of(scene, Model::Needed, None);
        let material = |(material, features): (&Material, &MaterialFeatures)| MaterialFinding {
            name: material.name.clone(),
            features: *features,
            roughness: material.roughness_range,
            metallic: material.metallic_range,
            occludes: material.occludes,
        };
        let materials: Vec<_> = scene.materials.iter().zip(&features.materials).map(material).collect();
        let mut findings = maps(&materials);
        findings.extend([metals(&materials), multi_scatter(&materials), roughness(&materials), lights(scene)]);
        findings.extend(shadows(scene, sun(&scene.environment.panorama)));
        Self { triangles: scene.triangles(), findings, materials, features }
    }

    /// One line for each decision, features that are used first.
    pub fn lines(&self) -> Vec<String> {
        let line = |mark, finding: &Finding| format!("{mark} {:22} {}", finding.subject, finding.why);
        let those = |modelled, mark| {
            self.findings.iter().filter(move |f| f.modelled == modelled).map(move |finding| line(mark, finding))
        };
        let pipelines = format!("{} pipeline(s) for {} material(s)", self.features.pipelines(), self.materials.len());
        std::iter::once(pipelines).chain(those(true, "+")).chain(those(false, "-")).collect()
    }
}

fn maps(materials: &[MaterialFinding]) -> Vec<Finding> {
    let all = materials.len();
    let finding = |subject, has: &dyn Fn(&MaterialFinding) -> bool, absent: &str| {
        let count = materials.iter().filter(|m| has(m)).count();
        let why = if count == 0 { absent.to_owned() } else { format!("{count} of {all} materials") };
        Finding { subject, modelled: count > 0, why }
    };
    vec![
        finding("base color maps", &|m| m.features.base_color_map, "no material has one that varies: factors only"),
        finding("normal maps", &|m| m.features.normal_map, "no material has one that is not flat"),
        finding(
            "roughness, metal maps",
            &|m| m.features.orm_map,
            "no material's roughness, metalness or occlusion varies: factors only",
        ),
        finding("occlusion", &|m| m.occludes, "no occlusion map is below 1"),
        finding("cutouts", &|m| m.features.alpha_mask, "no material has an alpha mask: no fragment is discarded"),
    ]
}

fn metals(materials: &[MaterialFinding]) -> Finding {
    let count = |kind| materials.iter().filter(|m| m.features.metalness == kind).count();
    let (dielectric, metal, mixed) = (count(Metalness::Dielectric), count(Metalness::Metal), count(Metalness::Mixed));
    let why = match (dielectric, metal, mixed) {
        (_, 0, 0) => "nothing is metallic: reflects 4 % at normal incidence".to_owned(),
        (0, _, 0) => "everything is metal: no diffuse light is looked up".to_owned(),
        _ => format!("{metal} material(s) all metal, {mixed} in parts, {dielectric} not at all"),
    };
    Finding { subject: "metalness", modelled: metal + mixed > 0, why }
}

fn multi_scatter(materials: &[MaterialFinding]) -> Finding {
    let (count, all) = (materials.iter().filter(|m| m.features.multi_scatter).count(), materials.len());
    let percent = format!("{:.2}", 100.0 * VISIBLE);
    let why = match count {
        0 => format!("no rough metal: multiple scattering between microfacets would add less than {percent} %"),
        _ => format!(
            "{count} of {all} materials are metals so rough that single scattering loses more than {percent} % of the light"
        ),
    };
    Finding { subject: "multiple scattering", modelled: count > 0, why }
}

fn roughness(materials: &[MaterialFinding]) -> Finding {
    let ranges = || materials.iter().map(|m| m.roughness);
    let least = ranges().map(|[least, _]| least).fold(1.0, f32::min);
    let most = ranges().map(|[_, most]| most).fold(0.0, f32::max);
    let why = format!("roughness {least:.2} to {most:.2}; light maps hold all levels, one file serves every scene");
    Finding { subject: "specular levels", modelled: true, why }
}

fn lights(scene: &Scene) -> Finding {
    let count = scene.lights.len();
    let why = if count == 0 {
        "the panorama is the only light".to_owned()
    } else {
        format!("{count}, a constant of the shaders")
    };
    Finding { subject: "point lights", modelled: count > 0, why }
}

/// Features that are not implemented although the scene would show them.
fn shadows(scene: &Scene, sun: Option<Sun>) -> Vec<Finding> {
    let sources = scene.lights.len() + usize::from(sun.is_some());
    let shadows = if sources == 0 {
        "no point light, no sun: nothing casts a hard shadow; occlusion maps stand in for soft ones".to_owned()
    } else {
        format!("{sources} source(s) would cast them; not modelled: nothing blocks their light")
    };
    let sun = match sun {
        Some(Sun { share, towards: [x, y, z] }) => {
            format!(
                "{:.0} % of all light, from ({x:.2}, {y:.2}, {z:.2}); part of the light maps, not a light of its own",
                share * 100.0
            )
        }
        None => format!("no part of the panorama gives {:.0} % of its light", SUN_SHARE * 100.0),
    };
    vec![
        Finding { subject: "shadows", modelled: false, why: shadows },
        Finding { subject: "sun", modelled: false, why: sun },
    ]
}

/// The panorama's sun, if it has one: the part within [`SUN_DEGREES`] of its brightest texel, if it has [`SUN_SHARE`]
/// or more of all light.
pub fn sun(panorama: &Panorama) -> Option<Sun> {
    let (width, height) = (panorama.width as usize, panorama.height as usize);
    let power = |texel: &[f32; 3]| texel.iter().map(|c| f64::from(*c)).sum::<f64>();
    let brightest = (0..panorama.texels.len())
        .into_par_iter()
        .max_by(|a, b| power(&panorama.texels[*a]).total_cmp(&power(&panorama.texels[*b])).then(b.cmp(a)))?;
    let direction = |x: usize, y: usize| panorama.direction(x as u32, y as u32);
    let towards = direction(brightest % width, brightest / width);
    let near = SUN_DEGREES.to_radians().cos();
    let rows = (0..height).into_par_iter().map(|y| {
        // The solid angle of a row's texels is proportional to the sine of its polar angle.
        let area = f64::from((PI * (y as f32 + 0.5) / height as f32).sin());
        let row = &panorama.texels[y * width..(y + 1) * width];
        let all: f64 = row.iter().map(power).sum();
        let inside = |(x, _): &(usize, &[f32; 3])| direction(*x, y).dot(towards) >= near;
        let sun: f64 = row.iter().enumerate().filter(inside).map(|(_, texel)| power(texel)).sum();
        (sun * area, all * area)
    });
    // Collected first: the order of a parallel sum, and so its rounding, would vary.
    let sums = rows.collect::<Vec<_>>().into_iter().fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
    let share = (sums.0 / sums.1) as f32;
    (share >= SUN_SHARE).then_some(Sun { towards: Vec3::to_array(&towards), share })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panorama(bright: Option<(u32, u32)>) -> Panorama {
        let (width, height) = (256, 128);
        let texel = |i: u32| if bright == Some((i % width, i / width)) { [20_000.0; 3] } else { [1.0; 3] };
        Panorama { name: "test".into(), width, height, texels: (0..width * height).map(texel).collect() }
    }

    #[test]
    fn a_sun_is_a_small_part_with_much_light() {
        assert_eq!(sun(&panorama(None)), None);
        let found = sun(&panorama(Some((10, 40)))).unwrap();
        let towards = panorama(None).direction(10, 40);
        assert!(Vec3::from_array(found.towards).distance(towards) < 1e-6);
        // One texel of 20,000 and its size against 4π of 1.
        let area = 2.0 * PI / 256.0 * PI / 128.0 * (PI * 40.5 / 128.0).sin();
        let truth = 20_000.0 * area / (4.0 * PI + 20_000.0 * area);
        assert!((found.share - truth).abs() < 0.002, "{} is not {truth}", found.share);
        // At the pole the same texel is too small to matter.
        assert_eq!(sun(&panorama(Some((10, 0)))), None);
    }

    #[test]
    fn the_share_that_counts_as_visible_is_rounded() {
        let features = MaterialFeatures::EVERYTHING;
        let metal =
            MaterialFinding { name: "m".into(), features, roughness: [1.0; 2], metallic: [1.0; 2], occludes: false };
        let without = MaterialFeatures { multi_scatter: false, ..features };
        for features in [features, without] {
            let finding = multi_scatter(&[MaterialFinding { features, ..metal.clone() }]);
            assert!(finding.why.contains(" 0.45 %"), "{}", finding.why);
        }
    }

    #[test]
    fn black_and_empty_panoramas_have_no_sun() {
        let black = Panorama { texels: vec![[0.0; 3]; 256 * 128], ..panorama(None) };
        assert_eq!(sun(&black), None);
        assert_eq!(sun(&Panorama { width: 0, height: 0, texels: vec![], ..black }), None);
    }
}
