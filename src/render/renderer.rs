//! A scene on the GPU and everything that draws it, frame by frame.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::Mat4;

use super::baked_light::BakedLight;
use super::bound_scene::{BAKE_MS, BoundScene};
use super::draws::{DrawCounts, DrawList};
use super::edits::{MaterialFactors, SceneEdits};
use super::eye::Eye;
use super::frame::FrameInputs;
use super::frame_set::FrameSet;
use super::hidden_area::HiddenArea;
use super::kept_pipelines::KeptPipelines;
use super::layouts::Layouts;
use super::lighting::Lighting;
use super::lightmapped::{LightmapRequest, Lightmapped};
use super::picker::Picker;
use super::pipeline_request::PipelineRequest;
use super::pipelines::PassPipelines;
use super::probe_maps::ProbeMaps;
use super::reference_accumulator::{ReferenceAccumulator, StandardError, jittered};
use super::rest::Rest;
use super::scene_resources::{Replaced, SceneResources, SceneTextures, TextureFacts};
use super::settings::RenderSettings;
use super::shared::FrameBlock;
use super::targets::{Detail, ViewTargets};
use super::texture_request::TextureRequest;
use crate::Result;
use crate::context::Context;
use crate::gpu::{FrameContext, Image, PassTime};
use crate::scene::Scene;

/// A scene on the GPU and everything that draws it.
pub struct Renderer {
    context: Context,
    pub(super) layouts: Arc<Layouts>,
    pub(super) scene: BoundScene,
    pipelines: PassPipelines,
    targets: ViewTargets,
    /// Only for `Shading::Reference`.
    reference: Option<ReferenceAccumulator>,
    hidden_area: Option<HiddenArea>,
    draws: DrawList,
    /// From the first time that something is picked.
    picker: Option<Picker>,
    /// Of the first eye's place.
    rest: Rest<Option<Mat4>>,
}

impl Renderer {
    /// Uploads a scene, precomputes its light and makes targets of `size` pixels for `eyes` eyes (1 to [`MAX_EYES`]).
    ///
    /// # Errors
    /// Sizes that the GPU cannot have, no memory, or a failed Vulkan call.
    pub fn new(context: &Context, scene: &Scene, settings: RenderSettings, size: [u32; 2], eyes: u32) -> Result<Self> {
        let never = AtomicBool::new(false);
        let prepare = |request: LightmapRequest| request.prepare(context, scene, &never);
        Self::with_lightmap(context, scene, settings, (size, eyes), prepare)
    }

    /// The same without a lightmap, which [`Renderer::set_lightmapped`] may bring later.
    ///
    /// # Errors
    /// Those of [`Renderer::new`].
    pub fn without_lightmap(
        context: &Context,
        scene: &Scene,
        settings: RenderSettings,
        size: [u32; 2],
        eyes: u32,
    ) -> Result<Self> {
        Self::with_lightmap(context, scene, settings, (size, eyes), |_| Ok(None))
    }

    /// [`Renderer::new`] for small pictures of one eye, with missing memory for the lightmap as an error.
    pub fn requiring_lightmap(context: &Context, scene: &Scene, settings: RenderSettings) -> Result<Self> {
        let never = AtomicBool::new(false);
        let require = |request: LightmapRequest| request.require(context, scene, &never);
        Self::with_lightmap(context, scene, settings, ([16; 2], 1), require)
    }

    fn with_lightmap(
        context: &Context,
        scene: &Scene,
        settings: RenderSettings,
        (size, eyes): ([u32; 2], u32),
        prepare: impl FnOnce(LightmapRequest) -> Result<Option<Lightmapped>>,
    ) -> Result<Self> {
        let gpu = &context.gpu;
        let mut kept = KeptPipelines::load(context);
        settings.textures.warn_if_raw(context);
        let layouts = Arc::new(Layouts::new(gpu)?);
        let textures = SceneTextures::new(context, &layouts, scene, &settings)?;
        let lighting = Lighting::new(context, &scene.environment.panorama, &settings)?;
        let (resources, baked) = match prepare(LightmapRequest::new(&layouts, &textures, &lighting, &settings))? {
            Some(Lightmapped { resources, baked }) => (resources, Some(baked)),
            None => (SceneResources::new(context, textures, scene, scene.geometry(), &settings)?, None),
        };
        let scene = BoundScene::new(gpu, &layouts, resources, lighting, baked)?;
        let request = scene.pipeline_request(gpu, &layouts, settings, eyes);
        let pipelines = context.report.time("pipelines", || PassPipelines::build(&request))?;
        kept.save();
        Ok(Self {
            targets: ViewTargets::new(gpu, size, eyes, Detail::of(&request.settings))?,
            reference: pipelines.accumulator(&request, size)?,
            context: context.clone(),
            layouts,
            scene,
            pipelines,
            hidden_area: None,
            draws: DrawList::default(),
            picker: None,
            rest: Rest::default(),
        })
    }

    /// The current settings.
    pub fn settings(&self) -> &RenderSettings {
        &self.pipelines.settings
    }

    /// The number of eyes.
    pub fn eyes(&self) -> u32 {
        self.pipelines.eyes
    }

    /// A request for pipelines of this scene with other settings or another number of eyes.
    pub fn pipeline_request(&self, settings: RenderSettings, eyes: u32) -> PipelineRequest {
        let request = self.scene.pipeline_request(&self.context.gpu, &self.layouts, settings, eyes);
        PipelineRequest { sky_relays: self.pipelines.sky_relays, ..request }
    }

    /// Replaces the pipelines, and the targets if their settings ask for others. On an error nothing changes.
    ///
    /// # Errors
    /// No memory for targets.
    pub fn set_pipelines(&mut self, pipelines: PassPipelines) -> Result<()> {
        let (size, eyes, detail) = (self.size(), pipelines.eyes, Detail::of(&pipelines.settings));
        let fit = eyes == self.eyes() && detail == self.targets.detail();
        let targets = (!fit).then(|| ViewTargets::new(&self.context.gpu, size, eyes, detail)).transpose()?;
        let request = self.pipeline_request(pipelines.settings.clone(), eyes);
        self.reference = pipelines.accumulator(&request, size)?;
        if eyes != self.eyes() {
            self.hidden_area = None;
        }
        self.pipelines = pipelines;
        if let Some(targets) = targets {
            self.targets = targets;
        }
        Ok(())
    }

    /// Draws at another scale; pipelines stay.
    ///
    /// # Errors
    /// No memory for targets.
    pub fn set_scale(&mut self, scale: f32) -> Result<()> {
        let settings = RenderSettings { scale, ..self.settings().clone() };
        self.targets = ViewTargets::new(&self.context.gpu, self.size(), self.eyes(), Detail::of(&settings))?;
        self.pipelines.settings = settings;
        Ok(())
    }

    /// Whether light precomputed with `settings` takes other pipelines: geometry, split sum, shadows and whether there is a sun
    /// are constants of theirs, and the reference draws its samples from the panorama.
    pub fn needs_pipelines_under(&self, lighting: &Lighting, settings: &RenderSettings) -> bool {
        let now = self.settings();
        let sun = self.pipeline_request_under(lighting, settings).shades_sun();
        now.geometry != settings.geometry
            || now.split_sum != settings.split_sum
            || self.pipelines.sun != sun
            || now.light != settings.light
            || self.reference.is_some()
    }

    /// What pipelines for this scene under another light, precomputed with `settings`, are built from.
    pub fn pipeline_request_under(&self, lighting: &Lighting, settings: &RenderSettings) -> PipelineRequest {
        let settings = self.settings().with_light_of(settings);
        PipelineRequest {
            panorama: Arc::clone(&lighting.maps.panorama),
            sun: lighting.sun,
            ..self.pipeline_request(settings, self.eyes())
        }
    }

    /// Puts the scene under another light, precomputed with `settings`, and draws it with the pipelines for that, where
    /// it takes others.
    ///
    /// # Errors
    /// No memory.
    pub fn set_lighting(
        &mut self,
        lighting: Lighting,
        settings: &RenderSettings,
        pipelines: Option<PassPipelines>,
    ) -> Result<()> {
        self.scene.set_lighting(&self.context.gpu, &self.layouts, lighting)?;
        self.pipelines.settings = self.settings().with_light_of(settings);
        pipelines.map_or(Ok(()), |pipelines| self.set_pipelines(pipelines))
    }

    /// What a lightmap for this scene is prepared from.
    pub fn lightmap_request(&self) -> LightmapRequest {
        let BoundScene { resources, lighting, .. } = &self.scene;
        LightmapRequest::new(&self.layouts, &resources.textures, lighting, self.settings())
    }

    /// What pipelines for this scene with a lightmap are built from.
    pub fn pipeline_request_lightmapped(&self, lightmapped: &Lightmapped) -> PipelineRequest {
        let Lightmapped { resources, baked } = lightmapped;
        PipelineRequest {
            lightmap_layers: baked.layers(),
            drawn: resources.drawn_kinds(),
            ray_scene: Arc::clone(&resources.ray_scene),
            ..self.pipeline_request(self.settings().clone(), self.eyes())
        }
    }

    /// Draws the scene with a lightmap from now on, with the pipelines for that.
    ///
    /// # Errors
    /// No memory.
    pub fn set_lightmapped(&mut self, lightmapped: Lightmapped, pipelines: PassPipelines) -> Result<()> {
        self.scene.set_lightmapped(&self.context.gpu, &self.layouts, lightmapped)?;
        self.set_pipelines(pipelines)
    }

    /// What the scene's textures are loaded with again, with other levels.
    pub fn texture_request(&self) -> TextureRequest {
        TextureRequest { layouts: Arc::clone(&self.layouts), settings: self.settings().clone() }
    }

    /// Draws with textures of [`Renderer::texture_request`] from now on. Those of a file that has changed meanwhile are refused.
    pub fn set_textures(&mut self, textures: SceneTextures) -> Replaced {
        self.begin_average();
        self.scene.resources.replace_textures(textures)
    }

    /// Changes of the scene as its file has it.
    pub fn edits(&self) -> &SceneEdits {
        self.scene.edits()
    }

    /// Shows the scene with these changes from the next frame on. Returns whether that takes other pipelines than the changes
    /// before, as [`Renderer::lacks_pipelines`] says.
    pub fn set_edits(&mut self, edits: SceneEdits) -> bool {
        self.begin_average();
        self.scene.set_edits(edits)
    }

    /// Whether the pipelines cannot show all factors of edited materials, or could show more than is needed.
    pub fn lacks_pipelines(&self) -> bool {
        self.pipelines.variants != self.scene.resources.variants_for(self.edits())
    }

    /// A material's factors as they are shown.
    pub fn factors(&self, material: usize) -> Option<MaterialFactors> {
        let block = self.scene.resources.material_blocks.get(material)?;
        Some(MaterialFactors::of(&self.edits().material(material, *block)))
    }

    /// The index of the material in the pixel that an eye sees, [`Eye::of_pixel`]; `None` for the sky. Waits for the GPU.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn pick(&mut self, eye: &Eye, world_from_models: Mat4) -> Result<Option<usize>> {
        let request = self.pipeline_request(self.settings().clone(), 1);
        let picker = match self.picker.take() {
            Some(picker) => picker,
            None => Picker::new(&request)?,
        };
        self.picker.insert(picker).material(&self.scene, eye, world_from_models)
    }

    /// Builds pipelines on the calling thread and uses them from now on; on an error the old ones stay.
    ///
    /// # Errors
    /// No memory; with `hot-reload`, a shader that does not compile.
    pub fn rebuild(&mut self, settings: RenderSettings, eyes: u32) -> Result<()> {
        let pipelines = PassPipelines::build(&self.pipeline_request(settings, eyes))?;
        self.set_pipelines(pipelines)
    }

    /// Replaces the targets; the old ones are destroyed once the GPU has finished with them.
    ///
    /// # Errors
    /// A size that the GPU cannot have; no memory.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if self.size() != size {
            let request = self.pipeline_request(self.settings().clone(), self.eyes());
            let targets = ViewTargets::new(&self.context.gpu, size, request.eyes, Detail::of(&request.settings))?;
            self.reference = self.pipelines.accumulator(&request, size)?;
            self.targets = targets;
        }
        Ok(())
    }

    /// Draws coarse pictures from now on, with a quarter of the pixels, or whole ones again; the reference is always whole.
    ///
    /// # Errors
    /// No memory.
    pub fn set_draft(&mut self, draft: bool) -> Result<()> {
        self.targets.set_draft(&self.context.gpu, draft && self.reference.is_none())
    }

    /// Whether the last frame was coarse.
    pub fn is_draft(&self) -> bool {
        self.targets.is_draft()
    }

    /// Whether the last frame is worth another one even if nothing moves: it was a draft, or light is still computed, or the
    /// reference averages.
    pub fn is_unfinished(&self) -> bool {
        self.is_draft() || self.reference.is_some() || self.light_progress().is_some()
    }

    /// Draws only the upper left `area` pixels of the picture from now on, at most all of them.
    pub fn set_area(&mut self, area: [u32; 2]) {
        let size = self.size();
        self.targets.area = [0, 1].map(|i| area[i].clamp(1, size[i]));
    }

    /// Sets the hidden area, which is not shaded from now on: triangles of each eye's picture as for [`HiddenArea::new`].
    ///
    /// # Errors
    /// No memory.
    pub fn set_hidden_area(&mut self, eyes: &[Vec<[f32; 2]>]) -> Result<()> {
        self.hidden_area = HiddenArea::new(&self.context.gpu, eyes)?;
        Ok(())
    }

    /// The draw counts of the last recorded frame.
    pub fn draw_counts(&self) -> DrawCounts {
        self.draws.counts(self.scene.resources.draws.len())
    }

    /// The resolved picture, one layer per eye, as the last recorded frame leaves it.
    pub fn picture(&self) -> &Arc<Image> {
        &self.targets.picture
    }

    /// The memory use of the scene's textures.
    pub fn texture_facts(&self) -> &TextureFacts {
        &self.scene.resources.textures.facts
    }

    /// GPU memory of the scene's textures, and of all their levels that the settings ask for, bytes.
    pub fn texture_bytes(&self) -> [u64; 2] {
        let SceneTextures { facts, needed_bytes, .. } = &self.scene.resources.textures;
        [facts.bytes, *needed_bytes]
    }

    /// GPU memory of shadow maps, bytes.
    pub fn shadow_bytes(&self) -> u64 {
        self.scene.shadows.bytes()
    }

    /// How often shadow maps have been drawn.
    pub fn shadow_drawings(&self) -> u64 {
        self.scene.shadows.drawings
    }

    /// GPU time of precomputation, pass by pass.
    pub fn precompute_times(&self) -> impl Iterator<Item = &PassTime> {
        self.scene.lighting.times()
    }

    /// The reference's standard error after the finished frame that had `slot`; `None` for other shading, and before the
    /// second frame.
    pub fn standard_error(&self, slot: usize) -> Option<StandardError> {
        self.reference.as_ref()?.standard_error(slot)
    }

    /// Begins a new average of the reference with the next frame, even if its inputs are the last frame's.
    pub fn begin_average(&mut self) {
        if let Some(reference) = &mut self.reference {
            reference.restart();
        }
    }

    /// Records one frame, into a ring of `FRAME_BYTES`.
    ///
    /// # Errors
    /// A ring with too few bytes.
    pub fn record(&mut self, frame: &mut FrameContext<'_>, inputs: &FrameInputs<'_>) -> Result<()> {
        self.scene.write_edits(&mut frame.commands);
        self.list_draws(inputs);
        if self.pipelines.lack_sky_relays(frame.slot) {
            let request = self.pipeline_request(self.settings().clone(), self.eyes());
            self.pipelines.add_sky_relays(request)?;
        }
        let rests = self.eye_rests(inputs);
        self.scene.update_shadows(&mut frame.commands, self.pipelines.shadows.as_ref(), inputs);
        let Self { scene, pipelines, targets, reference, draws, .. } = self;
        if reference.is_none() && scene.follow_light(inputs, &self.context.report)? {
            let block = inputs.block(scene.constants());
            scene.record_light(frame, &block, piece_ms(&self.context, inputs.eyes.len(), rests))?;
        }
        // After the light: with its last piece come the probes.
        let block = inputs.block(scene.constants());
        if let Some((reference, passes)) = reference.as_mut().zip(pipelines.reference.as_mut()) {
            let index = reference.next_index(block, targets.area);
            let eyes = Eye::each(inputs.eyes, |eye| jittered(eye, index, targets.area));
            let jittered = FrameInputs { eyes: &eyes[..inputs.eyes.len()], ..*inputs };
            let block = frame.push(&FrameBlock { sample_index: index, ..jittered.block(scene.constants()) })?;
            reference.record(frame, block, passes, targets, &scene.set, |commands, set, rays| {
                pipelines.forward.draw_surfaces(commands, set, scene, draws.calls(), Some(rays));
                pipelines.forward.draw_sky(commands, set, scene, Some(rays));
            });
            return Ok(());
        }
        let gizmos = inputs.gizmos.map_or(&[][..], |gizmos| gizmos.triangles());
        let (block, vertices) = (frame.push(&block)?, frame.push_bytes(bytemuck::cast_slice(gizmos))?);
        let set = FrameSet { set: frame.set, block };
        frame.commands.pass("scene", |commands| {
            targets.render(commands, |commands| {
                if let Some((pass, area)) = pipelines.hidden_area.as_ref().zip(self.hidden_area.as_ref()) {
                    pass.draw(commands, area);
                }
                pipelines.forward.draw_surfaces(commands, set, scene, draws.solid(), None);
                if let Some(pass) = &pipelines.gizmos {
                    pass.draw(commands, set, vertices, gizmos.len() as u32);
                }
                pipelines.forward.draw_sky(commands, set, scene, None);
                // Last: they are blended with all that is behind.
                pipelines.forward.draw_surfaces(commands, set, scene, draws.blended(), None);
            });
        });
        Ok(())
    }

    /// The lightmap, where there is one: irradiance of soft light, a layer for fronts and one for backs.
    pub fn lightmap(&self) -> Option<&Arc<Image>> {
        self.scene.baked.as_ref().map(BakedLight::lightmap)
    }

    /// What smooth surfaces mirror of the rooms around them, where there are probes.
    pub fn probes(&self) -> Option<&ProbeMaps> {
        self.scene.baked.as_ref()?.probes().map(|probes| &**probes)
    }

    /// The part of the lightmap that is computed, while it is; 0 to 1.
    pub fn light_progress(&self) -> Option<f32> {
        self.scene.light_progress().filter(|_| self.reference.is_none())
    }

    /// Computes lightmap and probes to their end; returns the GPU time that it took, milliseconds, 0 where there is nothing
    /// to do.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn finish_lightmap(&mut self, inputs: &FrameInputs<'_>) -> Result<f64> {
        self.scene.finish_light(&self.context, inputs)
    }

    /// Stores lightmap and probes in the cache, if they are done and not there yet. No frame may be in flight on another thread.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn keep_light(&mut self) -> Result<()> {
        self.scene.keep_light(&self.context)
    }

    /// Collects the draw calls. Models that are moved together are handled by moving the eyes the opposite way.
    fn list_draws(&mut self, inputs: &FrameInputs<'_>) {
        let models_from_world = inputs.world_from_models.inverse();
        let moved =
            Eye::each(inputs.eyes, |eye| Eye { world_from_view: models_from_world * eye.world_from_view, ..*eye });
        self.draws.fill(&self.scene.resources.draws, &moved[..inputs.eyes.len()], inputs.culling);
    }

    /// Whether the first eye has been where it is for some frames.
    fn eye_rests(&mut self, inputs: &FrameInputs<'_>) -> bool {
        self.rest.follow(inputs.eyes.first().map(|eye| eye.world_from_view)) >= REST
    }

    fn size(&self) -> [u32; 2] {
        self.targets.picture.desc().size
    }
}

/// Frames without a move after which a picture is taken to rest.
const REST: u32 = 4;

/// What a piece of a lightmap may take of each frame, milliseconds: little beside a headset's pictures, and on software
/// renderers, where a window's frame takes 100 to 200 ms, about as much; several times that where nothing moves.
fn piece_ms(context: &Context, eyes: usize, rests: bool) -> f64 {
    match (context.gpu.info().is_software(), eyes) {
        (true, 1) if rests => 8.0 * BAKE_MS,
        (true, 1) => 2.0 * BAKE_MS,
        (true, _) => BAKE_MS,
        (false, 1) => 10.0,
        (false, _) => 3.0,
    }
}
