# One of our scenes in Mitsuba 3: its picture, the pixels that show objects, errors of pictures over these, and its panorama for cmgen.
"""python mitsuba_scene.py render JOB.json PICTURE.exr FACTS.json SAMPLES
python mitsuba_scene.py objects JOB.json MASK.exr
python mitsuba_scene.py panorama JOB.json PANORAMA.exr      the scene's, turned as Filament's cmgen wants it
python mitsuba_scene.py errors REFERENCE.exr MASK.exr PICTURE.exr …    prints relative L1 errors as a JSON object, by file

Materials are Mitsuba's `principled` (Burley 2012 and 2015): metals as ours, with Schlick's Fresnel and GGX; its diffuse part is
Burley's, where ours is Lambert's times what the specular part leaves. Occlusion maps are left out: paths find what is hidden."""

import json
import sys
import tempfile
import time
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")


def texture(keys, map_key, factor_key, default, is_data):
    """A map, or the factor that stands for it."""
    factor = keys.get(factor_key) or default
    if map_key not in keys:
        return {"type": "rgb", "value": factor} if len(factor) == 3 else factor[0]
    if any(part != 1 for part in factor):
        raise SystemExit(f"{factor_key} {factor} beside {map_key}: only factors of 1 are read here")
    return {"type": "bitmap", "filename": keys[map_key], "raw": is_data}


def material(keys):
    made = {
        "type": "principled",
        "base_color": texture(keys, "map_kd", "kd", [1, 1, 1], False),
        "metallic": texture(keys, "map_pm", "pm", [0] if "map_pm" not in keys else [1], True),
        "roughness": texture(keys, "map_pr", "pr", [1], True),
        "specular": 0.5,
    }
    if "norm" in keys:
        made = {"type": "normalmap", "normalmap": {"type": "bitmap", "filename": keys["norm"], "raw": True}, "bsdf": made}
    return {"type": "twosided", "bsdf": made}


def parts(file):
    """An OBJ's text for each of its materials: Mitsuba gives a file one."""
    shared, faces, current = [], {}, None
    for line in Path(file).read_text().splitlines():
        key = line.split(None, 1)[0] if line.strip() else ""
        if key in ("v", "vt", "vn"):
            shared.append(line)
        elif key == "usemtl":
            current = line.split(None, 1)[1].strip()
        elif key == "f":
            faces.setdefault(current, []).append(line)
    return {name: "\n".join(shared + lines) + "\n" for name, lines in faces.items()}


def models(job, folder):
    for number, model in enumerate(job["models"]):
        turn = mi.ScalarTransform4f().translate(model["translation"])
        # Intrinsic X, Y, Z.
        for axis, angle in zip(([1, 0, 0], [0, 1, 0], [0, 0, 1]), model["rotation_degrees"]):
            turn = turn @ mi.ScalarTransform4f().rotate(axis, angle)
        turn = turn @ mi.ScalarTransform4f().scale(model["scale"])
        for part, (name, text) in enumerate(parts(model["file"]).items()):
            file = Path(folder) / f"{number}-{part}.obj"
            file.write_text(text)
            bsdf = material(model["materials"].get(name, {}))
            yield f"part-{number}-{part}", {"type": "obj", "filename": str(file), "to_world": turn, "bsdf": bsdf}


def scene(job, folder):
    camera, environment = job["camera"], job["environment"]
    # Its panoramas are turned against ours by a quarter.
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], 90 + environment["rotation_degrees"])
    lights = {
        f"light-{i}": {"type": "point", "position": light["point"]["position"],
                       "intensity": {"type": "rgb", "value": light["point"]["intensity"]}}
        for i, light in enumerate(job["lights"])
    }
    return mi.load_dict({
        "type": "scene",
        "panorama": {"type": "envmap", "filename": environment["panorama"], "to_world": turn},
        "sensor": {
            "type": "perspective", "fov": camera["vertical_fov_degrees"], "fov_axis": "y", "near_clip": 0.01, "far_clip": 1000,
            "to_world": mi.ScalarTransform4f().look_at(camera["position"], camera["target"], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": job["size"][0], "height": job["size"][1], "pixel_format": "rgb",
                     "component_format": "float32", "rfilter": {"type": "box"}},
        },
        **lights,
        **dict(models(job, folder)),
    })


def render(job, picture, facts, samples):
    with tempfile.TemporaryDirectory() as folder:
        loaded = scene(job, folder)
        started = time.process_time()
        # No bound on bounces; roulette only where little light is left.
        image = mi.render(loaded, integrator=mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 16}), spp=int(samples))
        seconds = time.process_time() - started
        mi.Bitmap(image).write(picture)
    Path(facts).write_text(json.dumps({"processor_seconds": seconds, "version": mi.__version__}) + "\n")


def objects(job, mask):
    with tempfile.TemporaryDirectory() as folder:
        depth = mi.render(scene(job, folder), integrator=mi.load_dict({"type": "aov", "aovs": "depth:depth"}), spp=16)
        seen = (np.array(depth)[..., -1:] > 0).astype(np.float32)
        mi.Bitmap(np.repeat(seen, 3, axis=2)).write(mask)


def panorama(job, output):
    """cmgen has +z in the middle, where ours have +x, and reads fewer kinds of OpenEXR. It takes the nearest texel, half a texel off:
    with four times as many, interpolated, neither is seen."""
    texels = pixels(job["environment"]["panorama"])
    height, width = texels.shape[:2]
    edges = (mi.FilterBoundaryCondition.Repeat, mi.FilterBoundaryCondition.Clamp)
    fine = np.array(mi.Bitmap(texels).resample([4 * width, 4 * height], mi.load_dict({"type": "tent"}), edges))
    turn = (90 + job["environment"]["rotation_degrees"]) / 360
    mi.Bitmap(np.roll(fine, -round(turn * 4 * width), axis=1)).write(output)


def pixels(file):
    return np.array(mi.Bitmap(file).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))


def errors(reference, mask, *pictures):
    exact, seen = pixels(reference), pixels(mask) > 0
    found = {file: float(np.abs(pixels(file) - exact)[seen].sum() / exact[seen].sum()) for file in pictures}
    print(json.dumps(found))


if __name__ == "__main__":
    what, *files = sys.argv[1:]
    if what == "errors":
        errors(*files)
    else:
        job = json.loads(Path(files[0]).read_text())
        {"render": render, "objects": objects, "panorama": panorama}[what](job, *files[1:])
