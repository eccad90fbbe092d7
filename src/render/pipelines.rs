//! The pipelines of all passes for one scene and one group of settings.

use super::forward::ForwardPass;
use super::gizmos::GizmoPass;
use super::hidden_area::HiddenAreaPass;
use super::pipeline_request::PipelineRequest;
use super::reference_accumulator::{ReferenceAccumulator, ReferencePasses};
use super::settings::{RenderSettings, Shading};
use super::surface_pass::SurfacePass;
use crate::Result;
use crate::scene::MaterialFeatures;

/// All pipelines; built again when shading, samples, output or the number of eyes change.
pub struct PassPipelines {
    pub(super) settings: RenderSettings,
    pub(super) eyes: u32,
    /// Whether they shade a sun.
    pub(super) sun: bool,
    /// Whether the reference's paths follow light from the panorama.
    pub(super) sky_relays: bool,
    /// The combinations of features that materials are drawn with.
    pub(super) variants: Vec<MaterialFeatures>,
    pub(super) forward: ForwardPass,
    /// Only with more than one eye.
    pub(super) gizmos: Option<GizmoPass>,
    pub(super) hidden_area: Option<HiddenAreaPass>,
    /// Only where something has a shadow map.
    pub(super) shadows: Option<SurfacePass>,
    /// Only for [`Shading::Reference`].
    pub(super) reference: Option<ReferencePasses>,
}

impl PassPipelines {
    /// Compiles all pipelines, which may take long. Any thread may call it.
    ///
    /// # Errors
    /// A failed Vulkan call; with `hot-reload`, a shader that does not compile.
    pub fn build(request: &PipelineRequest) -> Result<Self> {
        let PipelineRequest { settings, eyes, .. } = request;
        let is_reference = settings.shading == Shading::Reference;
        // The reference never shows gizmos, as all samples of a pixel must show the same scene.
        // The reference traces rays instead.
        let has_shadows = !is_reference && request.reads_shadows();
        let has_headset_passes = *eyes > 1 && !is_reference;
        Ok(Self {
            settings: settings.clone(),
            eyes: *eyes,
            sun: request.shades_sun(),
            sky_relays: request.sky_relays,
            variants: request.variants.clone(),
            forward: ForwardPass::new(request)?,
            gizmos: has_headset_passes.then(|| GizmoPass::new(request)).transpose()?,
            hidden_area: has_headset_passes.then(|| HiddenAreaPass::new(request)).transpose()?,
            shadows: has_shadows.then(|| SurfacePass::shadow(request)).transpose()?,
            reference: is_reference.then(|| ReferencePasses::new(request)).transpose()?,
        })
    }

    /// Whether the reference, as far as the finished frame knew that had `slot`, has found that its paths should follow light from
    /// the panorama, for which they have no code: few scenes are such rooms.
    pub(super) fn lack_sky_relays(&self, slot: usize) -> bool {
        !self.sky_relays && self.reference.as_ref().is_some_and(|passes| passes.wants_sky_relays(slot))
    }

    /// Gives it to them, on the calling thread; their average goes on, as both kinds of paths have the same mean.
    pub(super) fn add_sky_relays(&mut self, request: PipelineRequest) -> Result<()> {
        self.forward = ForwardPass::new(&PipelineRequest { sky_relays: true, ..request })?;
        self.sky_relays = true;
        Ok(())
    }

    /// The request that they were built from.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The number of eyes they draw for.
    pub fn eyes(&self) -> u32 {
        self.eyes
    }

    /// The reference's accumulator for pictures of `size` pixels, if its passes exist.
    pub(super) fn accumulator(
        &self,
        request: &PipelineRequest,
        size: [u32; 2],
    ) -> Result<Option<ReferenceAccumulator>> {
        self.reference.as_ref().map(|_| ReferenceAccumulator::new(request, size)).transpose()
    }
}
