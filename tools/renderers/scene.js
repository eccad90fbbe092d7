// The models of a job as three.js' objects, for pages that draw or export them. Cut-outs are not read: their texels are opaque.
import * as THREE from "three";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";

export const RADIANS = Math.PI / 180;

function material(keys, textures) {
    const made = new THREE.MeshStandardMaterial();
    made.color.setRGB(...(keys.kd ?? [1, 1, 1]), THREE.LinearSRGBColorSpace);
    made.metalness = keys.pm?.[0] ?? (keys.map_pm ? 1 : 0);
    made.roughness = keys.pr?.[0] ?? 1;
    const maps = { map: "map_kd", normalMap: "norm", metalnessMap: "map_pm", roughnessMap: "map_pr", aoMap: "map_ao" };
    for (const [slot, key] of Object.entries(maps)) {
        if (keys[key]) made[slot] = textures.get(keys[key], slot === "map");
    }
    return made;
}

/** Textures by file, loaded once. */
class Textures {
    constructor() {
        this.loader = new THREE.TextureLoader();
        this.made = new Map();
    }

    get(file, isColour) {
        if (!this.made.has(file)) {
            const loading = this.loader.loadAsync("/file" + file).then((texture) => Object.assign(this.made.get(file), { image: texture.image, needsUpdate: true }));
            const texture = new THREE.Texture();
            texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
            texture.colorSpace = isColour ? THREE.SRGBColorSpace : THREE.NoColorSpace;
            this.made.set(file, texture);
            this.loading = Promise.all([this.loading, loading]);
        }
        return this.made.get(file);
    }
}

async function add(scene, model, textures) {
    const object = await new OBJLoader().loadAsync("/file" + model.file);
    const materials = Object.fromEntries(Object.entries(model.materials).map(([name, keys]) => [name, material(keys, textures)]));
    object.traverse((part) => {
        if (!part.isMesh) return;
        const own = (old) => materials[old.name] ?? old;
        part.material = Array.isArray(part.material) ? part.material.map(own) : own(part.material);
        part.castShadow = part.receiveShadow = true;
    });
    object.position.set(...model.translation);
    object.rotation.set(...model.rotation_degrees.map((angle) => angle * RADIANS), "XYZ");
    object.scale.setScalar(model.scale);
    scene.add(object);
}

/** A scene with all models of a job; their textures are there. */
export async function models(job) {
    const scene = new THREE.Scene();
    const textures = new Textures();
    for (const model of job.models) await add(scene, model, textures);
    await textures.loading;
    return scene;
}

/** Bytes as base64: what a page can answer with. */
export function base64(bytes) {
    let text = "";
    for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
    return btoa(text);
}
