//! Whether a scene's mirror images need probes, and where.

use glam::Vec3;

use crate::scene::bvh::Bvh;
use crate::scene::probes::{MOST_PROBES, Placement, place};
use crate::scene::{Material, Model, Probe, Scene};

/// Rougher dielectrics mirror 4 % of light from so far around that its mean, which the lightmap holds, is as good.
const SMOOTH: f32 = 0.6;
/// Metal in a smaller share than this shows no more than a dielectric does.
const METALLIC: f32 = 0.1;

/// The probes of a scene, and why there are these.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbePlan {
    /// The smallest first; at most [`MOST_PROBES`].
    pub probes: Vec<Probe>,
    pub why: String,
}

/// Whether mirror images show on something.
pub fn any(scene: &Scene, model: Model) -> bool {
    counted(scene, model)[0] > 0
}

/// Whether mirror images show on some part of a material.
fn is_smooth(material: &Material, model: Model) -> bool {
    model == Model::Everything || material.roughness_range[0] < SMOOTH || material.metallic_range[1] > METALLIC
}

impl ProbePlan {
    /// Decides for a scene whose triangles are under this hierarchy: its own, or the same instances with other meshes.
    pub fn new(scene: &Scene, model: Model, bvh: &Bvh) -> Self {
        Self::without_rays(scene, model).unwrap_or_else(|| Self::by_rays(scene, model, bvh))
    }

    /// The decision, if no rays are needed for it.
    pub fn without_rays(scene: &Scene, model: Model) -> Option<Self> {
        let [count, all] = counted(scene, model);
        if count == 0 {
            return Some(Self { probes: Vec::new(), why: "no metal and nothing smooth, no probe".into() });
        }
        let why = || format!("{count} of {all} materials are metal or smooth; {} by hand", scene.probes.len());
        (!scene.probes.is_empty()).then(|| Self { probes: scene.probes.clone(), why: why() })
    }

    fn by_rays(scene: &Scene, model: Model, bvh: &Bvh) -> Self {
        let of_instance: Vec<bool> = scene
            .instances
            .iter()
            .map(|i| scene.materials.get(scene.meshes[i.mesh].material).is_some_and(|m| is_smooth(m, model)))
            .collect();
        let smooth = |triangle: usize| of_instance[bvh.triangles()[triangle].instance as usize];
        let cameras: Vec<Vec3> = scene.cameras.iter().map(|camera| camera.position).collect();
        let Placement { probes, sees_smooth, open, crowded } = place(bvh, &cameras, smooth);
        let [count, all] = counted(scene, model);
        let of = format!("{count} of {all} materials are metal or smooth");
        let things = probes.iter().filter(|probe| probe.thing.is_some()).count();
        let why = match [probes.len() - things, things] {
            [0, 0] if !sees_smooth => format!("{of}, but none is seen from the cameras: no probe"),
            [0, 0] if crowded => {
                format!("{of}, on more things than the {MOST_PROBES} that there are probes for")
            }
            [0, 0] if open > 0 => format!("{of}, but around them is mostly sky, the panorama itself: no probe"),
            [0, 0] => format!("{of}, but there is no room around them: no probe"),
            [MOST_PROBES, 0] => format!("{of}; one for each of the first {MOST_PROBES} rooms that they are seen in"),
            [rooms, 0] => format!("{of}; one for each room that they are seen in: {rooms}, found by rays"),
            [0, things] => format!("{of}; {things} around things in the open, found by rays"),
            [rooms, things] => {
                format!("{of}; {rooms} for rooms, {things} around things, found by rays")
            }
        };
        Self { probes, why }
    }
}

/// Materials that show mirror images, and all.
fn counted(scene: &Scene, model: Model) -> [usize; 2] {
    [scene.materials.iter().filter(|m| is_smooth(m, model)).count(), scene.materials.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Bounds;
    use crate::scene::needs::tests::scene;

    fn plan(metallic: f32, roughness: f32, model: Model) -> ProbePlan {
        let material = Material::plain("plain", Vec3::ONE, metallic, roughness);
        let bounds = Bounds { min: -Vec3::ONE, max: Vec3::ONE };
        let by_hand = vec![Probe { position: Vec3::ZERO, bounds, thing: None }];
        let scene = Scene { probes: by_hand, ..scene(vec![material], 1) };
        ProbePlan::new(&scene, model, &Bvh::new(&scene.meshes, &scene.instances).unwrap())
    }

    #[test]
    fn only_what_mirrors_needs_probes() {
        for (metallic, roughness, probes) in [(0.0, 0.7, 0), (0.0, 0.5, 1), (1.0, 0.9, 1), (0.05, 0.9, 0)] {
            let ProbePlan { probes: found, why } = plan(metallic, roughness, Model::Needed);
            assert_eq!(found.len(), probes, "metallic {metallic}, roughness {roughness}: {why}");
            assert!(why.contains(["no metal and nothing smooth", "1 of 1 materials"][probes]), "{why}");
        }
        assert_eq!(plan(0.0, 1.0, Model::Everything).probes.len(), 1);
    }
}
