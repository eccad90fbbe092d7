//! The decisions of `needs` in words: which features are used for a scene, which are not, and why.

use serde::Serialize;

use super::casting::nothing_casts;
use super::lightmap::{LightmapNeed, needs_no_lightmap};
use super::mirrors::{self, ProbePlan};
use super::{MaterialFeatures, Metalness, Model, SceneFeatures, VertexColours};
use crate::reference::energy::VISIBLE;
use crate::reference::sun::{Sun, VISIBLE_SHARE, find_sun};
use crate::scene::bvh::Bvh;
use crate::scene::sphere_lights::SphereLight;
use crate::scene::{Material, MaterialSource, Scene};

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
    pub source: MaterialSource,
}

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
            source: MaterialSource::default(),
        };
        let mut materials: Vec<_> = scene.materials.iter().zip(&features.materials).map(material).collect();
        for (material, source) in materials.iter_mut().zip(&scene.sources) {
            material.source.clone_from(source);
        }
        let mut findings = maps(&materials);
        findings.extend([metals(&materials), multi_scatter(&materials), roughness(&materials), lights(scene)]);
        let panorama = &scene.environment.panorama;
        let sun = find_sun([panorama.width, panorama.height], &panorama.texels).map(|split| split.sun);
        findings.extend([sun_finding(sun), lamp_shadows(scene), sun_shadow(scene, sun), soft_light(scene)]);
        findings.extend([local_probes(scene), sphere_lights(scene)]);
        Self { triangles: scene.triangles(), findings, materials, features }
    }

    /// One line for each decision, features that are used first, and one for each material.
    pub fn lines(&self) -> Vec<String> {
        let line = |mark, finding: &Finding| format!("{mark} {:22} {}", finding.subject, finding.why);
        let those = |modelled, mark| {
            self.findings.iter().filter(move |f| f.modelled == modelled).map(move |finding| line(mark, finding))
        };
        let pipelines = format!("{} pipeline(s) for {} material(s)", self.features.pipelines(), self.materials.len());
        let decisions = std::iter::once(pipelines).chain(those(true, "+")).chain(those(false, "-"));
        decisions.chain(self.materials.iter().map(MaterialFinding::line)).collect()
    }
}

impl MaterialFinding {
    /// Its maps, and what was guessed.
    fn line(&self) -> String {
        let MaterialSource { maps, guesses } = &self.source;
        let maps = if maps.is_empty() { "no maps".into() } else { maps.join(", ") };
        let guessed = if guesses.is_empty() { String::new() } else { format!("; guessed: {}", guesses.join(", ")) };
        format!("{}: {maps}{guessed}", self.name)
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
        finding(
            "blending",
            &|m| m.features.blends,
            "no material lets through what is behind: all is drawn once, in any order",
        ),
        finding(
            "specular factors",
            &|m| m.features.specular,
            "what is no metal reflects all colours alike, and all at grazing angles",
        ),
        finding("clear coats", &|m| m.features.clearcoat, "no surface has a coat over it"),
        finding("sheen", &|m| m.features.sheen, "nothing is cloth with a sheen"),
        finding("anisotropy", &|m| m.features.anisotropy, "no highlight is longer than wide"),
        finding("iridescence", &|m| m.features.film, "nothing has a thin film over it"),
        finding("diffuse transmission", &|m| m.features.diffuse_transmission, "no light diffuses through thin sheets"),
        finding(
            "extension maps",
            &|m| m.features.extension_map.is_some(),
            "no sheen, specular factor or stretch of highlights varies",
        ),
        finding("refraction", &|m| m.features.refracts, "nothing is a convex body of glass"),
        finding("emission", &|m| m.features.emits, "no material shines"),
        finding("vertex colours", &|m| m.features.vertex_colours != VertexColours::None, "all are white"),
        finding(
            "second coordinates",
            &|m| m.features.second_uv != 0,
            "all maps of each material share their texture coordinates",
        ),
    ]
}

fn metals(materials: &[MaterialFinding]) -> Finding {
    let count = |kind| materials.iter().filter(|m| m.features.metalness == kind).count();
    let (dielectric, metal, mixed) = (count(Metalness::Dielectric), count(Metalness::Metal), count(Metalness::Mixed));
    let why = match (dielectric, metal, mixed) {
        (_, 0, 0) => "nothing is metallic: reflections have no color".to_owned(),
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

/// The sun, a light of its own.
fn sun_finding(sun: Option<Sun>) -> Finding {
    let why = match sun {
        Some(Sun { share, direction, angular_radius, .. }) => {
            let (percent, degrees) = (100.0 * share, angular_radius.to_degrees());
            let [x, y, z] = direction.to_array();
            format!(
                "{percent:.1} % of the panorama's light, a disc of radius {degrees:.2}° at ({x:.2}, {y:.2}, {z:.2})"
            )
        }
        None => format!("no single small source gives {:.0} % of the panorama's light", 100.0 * VISIBLE_SHARE),
    };
    Finding { subject: "sun", modelled: sun.is_some(), why }
}

fn lamp_shadows(scene: &Scene) -> Finding {
    let (lamps, soft) = (scene.lights.len(), scene.lights.iter().filter(|lamp| lamp.radius > 0.0).count());
    let (modelled, why) = match nothing_casts(scene) {
        _ if lamps == 0 => (false, "there is no lamp".to_owned()),
        Some(reason) => (false, reason.to_owned()),
        None if soft == 0 => (true, format!("a map for each of {lamps} lamps, all points: edges are sharp")),
        None => (true, format!("a map for each of {lamps} lamps, {soft} with a size: edges soften with distance")),
    };
    Finding { subject: "shadows of lamps", modelled, why }
}

fn soft_light(scene: &Scene) -> Finding {
    if let Some(reason) = needs_no_lightmap(scene, Model::Needed) {
        return Finding { subject: "soft light", modelled: false, why: reason.to_owned() };
    }
    let LightmapNeed { side, hidden } = LightmapNeed::new(scene, Model::Needed, None);
    let mut why = format!("things block light and give it back: a lightmap of {side}x{side} texels");
    if hidden.iter().flatten().any(|hidden| *hidden) {
        why += ", fewer on surfaces that no camera can see";
    }
    Finding { subject: "soft light", modelled: true, why }
}

fn sun_shadow(scene: &Scene, sun: Option<Sun>) -> Finding {
    let (modelled, why) = match (sun, nothing_casts(scene)) {
        (None, _) => (false, "there is no sun".to_owned()),
        (_, Some(reason)) => (false, reason.to_owned()),
        (Some(Sun { angular_radius, .. }), None) => {
            // An edge 1 m from what its shadow falls on.
            let millimetres = 2e3 * angular_radius.tan();
            (true, format!("one map of all that casts; edges soften by {millimetres:.0} mm for each metre"))
        }
    };
    Finding { subject: "shadow of the sun", modelled, why }
}

fn sphere_lights(scene: &Scene) -> Finding {
    let count = SphereLight::all(scene.geometry(), &scene.materials).len();
    let (modelled, why) = match count {
        0 => (false, "nothing small and round shines".to_owned()),
        _ if !mirrors::any(scene, Model::Needed) => {
            (false, "no metal and nothing smooth mirrors what shines".to_owned())
        }
        _ => (true, format!("{count} small surfaces that shine: mirror images show them where they are")),
    };
    Finding { subject: "sphere lights", modelled, why }
}

fn local_probes(scene: &Scene) -> Finding {
    let by_rays = || match Bvh::new(&scene.meshes, &scene.instances) {
        Ok(bvh) => ProbePlan::new(scene, Model::Needed, &bvh),
        Err(error) => ProbePlan { probes: Vec::new(), why: format!("{error}: no probe") },
    };
    let ProbePlan { probes, why } = ProbePlan::without_rays(scene, Model::Needed).unwrap_or_else(by_rays);
    Finding { subject: "reflection probes", modelled: !probes.is_empty(), why }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_sun_is_told_with_its_share() {
        let sun = Sun { direction: DVec3::Y, irradiance: DVec3::ONE, angular_radius: 0.01, share: 0.256 };
        let finding = sun_finding(Some(sun));
        assert!(finding.modelled && finding.why.contains("25.6 %") && finding.why.contains("0.57°"), "{finding:?}");
        assert!(!sun_finding(None).modelled);
    }

    #[test]
    fn the_share_that_counts_as_visible_is_rounded() {
        let features = MaterialFeatures::EVERYTHING;
        let metal = MaterialFinding {
            name: "m".into(),
            features,
            roughness: [1.0; 2],
            metallic: [1.0; 2],
            occludes: false,
            source: MaterialSource::default(),
        };
        let without = MaterialFeatures { multi_scatter: false, ..features };
        for features in [features, without] {
            let finding = multi_scatter(&[MaterialFinding { features, ..metal.clone() }]);
            assert!(finding.why.contains(" 0.45 %"), "{}", finding.why);
        }
    }
}
