// A scene of ours in filament.js: its glTF loader's materials, cmgen's reflections and spherical harmonics, point lights. The models
// come as the glTF that three.js writes of what three_page.js draws, with vertices that are shared, as glTF files have them.
import { GLTFExporter } from "three/addons/exporters/GLTFExporter.js";
import { mergeVertices } from "three/addons/utils/BufferGeometryUtils.js";
import { base64, models } from "/scene.js";

const WebGL2 = WebGL2RenderingContext.prototype;

/** A classic script, which defines a global name. */
function script(address) {
    const element = document.createElement("script");
    return new Promise((onload, onerror) => document.head.append(Object.assign(element, { src: address, onload, onerror })));
}

async function bytes(address) {
    const response = await fetch(address);
    if (!response.ok) throw new Error(`${address}: ${response.status}`);
    return new Uint8Array(await response.arrayBuffer());
}

async function glb(job) {
    const scene = await models(job);
    scene.traverse((part) => {
        if (part.isMesh) part.geometry = mergeVertices(part.geometry, 1e-6);
    });
    return new Uint8Array(await new GLTFExporter().parseAsync(scene, { binary: true }));
}

/** To the event loop, without which Filament finds no frame done. */
const pause = () => new Promise((go) => setTimeout(go));

/** An engine with the job's scene; the views of all settings share it. */
class Stage {
    async load(job) {
        const { Filament } = window;
        this.size = job.size;
        // Not in the document, so that nobody composes it.
        const canvas = Object.assign(document.createElement("canvas"), { width: job.size[0], height: job.size[1] });
        const engine = (this.engine = Filament.Engine.create(canvas));
        this.gl = canvas.getContext("webgl2");
        this.driver = this.gl.getParameter(this.gl.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL);
        this.renderer = engine.createRenderer();
        this.swapChain = engine.createSwapChain();
        this.scene = engine.createScene();
        await this.addModels(await glb(job));
        this.addPanorama(await bytes("/file" + job.ktx.reflections), await bytes("/file" + job.ktx.sky));
        for (const { point } of job.lights) this.addLamp(point);
        this.camera = engine.createCamera(Filament.EntityManager.get().create());
        const { position, target, vertical_fov_degrees: angle } = job.camera;
        this.camera.setProjectionFov(angle, job.size[0] / job.size[1], 0.01, 100, Filament.Camera$Fov.VERTICAL);
        this.camera.lookAt(position, target, [0, 1, 0]);
        // Radiance 1 is 1 in the picture.
        this.camera.setExposureDirect(1);
        return this;
    }

    async addModels(content) {
        const asset = this.engine.createAssetLoader().createAsset(content);
        await new Promise((done) => asset.loadResources(done, null, null, 1));
        this.scene.addEntities(asset.getEntities());
    }

    addPanorama(reflections, sky) {
        // This helper leaves spherical harmonics out, but has read them.
        const read = this.engine.createIblFromKtx1(reflections);
        const light = window.Filament.IndirectLight.Builder().reflections(read.getReflectionsTexture()).irradianceSh(3, read.shfloats);
        const made = light.build(this.engine);
        made.setIntensity(1);
        this.scene.setIndirectLight(made);
        this.scene.setSkybox(this.engine.createSkyFromKtx1(sky));
    }

    addLamp({ position, intensity }) {
        const { Filament } = window;
        const strongest = Math.max(...intensity);
        const entity = Filament.EntityManager.get().create();
        Filament.LightManager.Builder(Filament.LightManager$Type.POINT)
            .color(intensity.map((part) => part / strongest))
            // In lumens, over all directions; its light ends far outside of the scene.
            .intensity(4 * Math.PI * strongest)
            .falloff(1000)
            .position(position)
            .build(this.engine, entity);
        this.scene.addEntity(entity);
    }

    view(samples) {
        const { Filament } = window;
        const view = this.engine.createView();
        view.setScene(this.scene);
        view.setCamera(this.camera);
        view.setViewport([0, 0, ...this.size]);
        view.setAntiAliasing(Filament.View$AntiAliasing.NONE);
        view.setMultiSampleAntiAliasingOptions({ enabled: samples > 1, sampleCount: samples });
        return view;
    }

    async frame(view) {
        while (!this.renderer.beginFrame(this.swapChain)) {
            this.engine.execute();
            await pause();
        }
        this.renderer.renderView(view);
        this.renderer.endFrame();
        this.engine.execute();
    }

    /** Reads a framebuffer without Filament's noticing. */
    read(framebuffer, [width, height], type, pixels) {
        const { gl } = this;
        const [bound, buffer] = [gl.getParameter(gl.READ_FRAMEBUFFER_BINDING), gl.getParameter(gl.PIXEL_PACK_BUFFER_BINDING)];
        WebGL2.bindBuffer.call(gl, gl.PIXEL_PACK_BUFFER, null);
        WebGL2.bindFramebuffer.call(gl, gl.READ_FRAMEBUFFER, framebuffer);
        gl.readPixels(0, 0, width, height, gl.RGBA, type, pixels);
        WebGL2.bindFramebuffer.call(gl, gl.READ_FRAMEBUFFER, bound);
        WebGL2.bindBuffer.call(gl, gl.PIXEL_PACK_BUFFER, buffer);
    }
}

/** Everything that one setting draws with: `samples` of each pixel. */
class Drawing {
    constructor(stage, samples) {
        Object.assign(this, { stage, samples, view: stage.view(samples) });
    }

    /** Draws frames into the canvas, and waits for each. */
    async draw(frames) {
        const { stage } = this;
        const pixel = new Uint8Array(4);
        for (let i = 0; i < frames; i++) {
            await stage.frame(this.view);
            stage.read(null, [1, 1], stage.gl.UNSIGNED_BYTE, pixel);
            await pause();
        }
    }

    /** Linear radiance, rows from below: RGBA halves as base64. It is what a frame's last pass, tone mapping into the canvas, reads:
     * Filament's buffer of light, of half floats, which is found when it is left: the last of one sample that has colours. */
    async picture() {
        const { stage } = this;
        const { gl, size } = stage;
        const pixels = new Float32Array(4 * size[0] * size[1]);
        const kind = () => gl.getFramebufferAttachmentParameter(gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE);
        let found = false;
        let samples = 1;
        gl.bindFramebuffer = (where, framebuffer) => {
            const drawn = gl.getParameter(gl.DRAW_FRAMEBUFFER_BINDING);
            samples = Math.max(samples, gl.getParameter(gl.SAMPLES));
            if (where !== gl.READ_FRAMEBUFFER && drawn !== null && gl.getParameter(gl.SAMPLES) === 0 && kind() !== gl.NONE) {
                stage.read(drawn, size, gl.FLOAT, pixels);
                found = true;
            }
            WebGL2.bindFramebuffer.call(gl, where, framebuffer);
        };
        await this.draw(1);
        delete gl.bindFramebuffer;
        const error = gl.getError();
        if (!found || error !== gl.NO_ERROR) throw new Error(`its buffer of light cannot be read: ${found ? error : "there is none"}`);
        if (samples !== this.samples) throw new Error(`${samples} samples instead of ${this.samples}`);
        // A few pixels of Sponza are not numbers; they count as black.
        return base64(new Uint8Array(Float16Array.from(pixels, (part) => part || 0).buffer));
    }
}

await script("/modules/filament/filament.js");
await new Promise((ready) => window.Filament.init([], ready));
const drawings = new Map();
let stage = null;
window.draw = (key, frames) => drawings.get(key).draw(frames);
window.picture = (key) => drawings.get(key).picture();
// Last, as what is waited for.
window.load = async (key, samples, shadows) => {
    // With them, lamps give no light at all on WebGL in 1.53.4.
    if (shadows) throw new Error("shadows of lamps are not drawn with filament.js here");
    stage ??= await new Stage().load(await (await fetch("/job")).json());
    drawings.set(key, new Drawing(stage, samples));
    await drawings.get(key).draw(3);
    return stage.driver;
};
