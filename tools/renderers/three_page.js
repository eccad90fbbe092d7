// A scene of ours in three.js, as its documentation has it: standard materials, a prefiltered panorama, point lights; where nothing
// is said here, its defaults: no anisotropy, no backs of faces.
import * as THREE from "three";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";
import { RADIANS, base64, models } from "/scene.js";

async function panorama(environment) {
    const loader = environment.panorama.endsWith(".exr") ? new EXRLoader() : new HDRLoader();
    const texture = await loader.setDataType(THREE.FloatType).loadAsync("/file" + environment.panorama);
    texture.mapping = THREE.EquirectangularReflectionMapping;
    return texture;
}

/** Everything that one setting draws with: `samples` of each pixel, `shadows` of lamps. */
class Drawing {
    async load(job, samples, shadows) {
        this.size = job.size;
        this.samples = samples;
        this.renderer = new THREE.WebGLRenderer({ antialias: samples > 1 });
        this.renderer.setPixelRatio(1);
        this.renderer.setSize(...job.size);
        this.renderer.shadowMap.enabled = shadows;
        const gl = this.renderer.getContext();
        const name = gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL);
        if (samples > 1 && gl.getParameter(gl.SAMPLES) !== samples) throw new Error(`${gl.getParameter(gl.SAMPLES)} samples instead of ${samples}`);
        this.scene = await models(job);
        for (const { point } of job.lights) {
            const light = new THREE.PointLight();
            light.color.setRGB(...point.intensity, THREE.LinearSRGBColorSpace);
            light.position.set(...point.position);
            light.castShadow = shadows;
            if (shadows) {
                light.shadow.mapSize.set(1024, 1024);
                light.shadow.camera.near = 0.02;
                light.shadow.bias = -0.002;
            }
            this.scene.add(light);
        }
        const sky = await panorama(job.environment);
        this.scene.background = sky;
        this.scene.environment = new THREE.PMREMGenerator(this.renderer).fromEquirectangular(sky).texture;
        const turn = job.environment.rotation_degrees * RADIANS;
        this.scene.backgroundRotation.y = this.scene.environmentRotation.y = turn;
        const { position, target, vertical_fov_degrees: angle } = job.camera;
        this.camera = new THREE.PerspectiveCamera(angle, job.size[0] / job.size[1], 0.01, 100);
        this.camera.position.set(...position);
        this.camera.lookAt(...target);
        // Shadow maps are drawn once, as nothing moves.
        this.draw(2);
        this.renderer.shadowMap.autoUpdate = false;
        return name;
    }

    /** Draws frames into the canvas, and waits for each. */
    draw(frames) {
        const gl = this.renderer.getContext();
        const pixel = new Uint8Array(4);
        for (let i = 0; i < frames; i++) {
            this.renderer.render(this.scene, this.camera);
            gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        }
    }

    /** Linear radiance, rows from below: RGBA halves as base64. */
    picture() {
        const [width, height] = this.size;
        const options = { type: THREE.HalfFloatType, samples: this.samples > 1 ? this.samples : 0 };
        const target = new THREE.WebGLRenderTarget(width, height, options);
        this.renderer.setRenderTarget(target);
        this.renderer.render(this.scene, this.camera);
        const pixels = new Uint16Array(4 * width * height);
        this.renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
        this.renderer.setRenderTarget(null);
        target.dispose();
        return base64(new Uint8Array(pixels.buffer));
    }
}

const drawings = new Map();
window.draw = (key, frames) => drawings.get(key).draw(frames);
window.picture = (key) => drawings.get(key).picture();
// Last, as what is waited for.
window.load = async (key, samples, shadows) => {
    const drawing = new Drawing();
    drawings.set(key, drawing);
    return drawing.load(await (await fetch("/job")).json(), samples, shadows);
};
