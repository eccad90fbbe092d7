# Scenes of ours as jobs for other renderers, Blender's Cycles among them, and what tools that compare renderers have in common.
"""Standard library only. Used by tools/cycles-reference and tools/compare-renderers."""

import json
import math
import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Light between white walls is worth following for long: after 13 bounces a per cent of a closed room's is still missing.
BOUNCES = 128
# Of Cycles: what differs from {"unoccluded": True, "principled": False, "bounces": 0, "seed": 0}.
PICTURES = {
    "matched": {},
    "noise": {"seed": 1},
    "principled": {"principled": True},
    "direct": {"unoccluded": False},
    "full": {"unoccluded": False, "bounces": BOUNCES},
    "full-noise": {"unoccluded": False, "bounces": BOUNCES, "seed": 1},
}
LARGE_SCENES = "${PBR_VR_SCENES}/"


def fail(message):
    print(f"{Path(sys.argv[0]).name}: {message}", file=sys.stderr)
    sys.exit(1)


def find_program(given):
    found = [Path(given)] if given else [ROOT / "target" / kind / "pbr-vr" for kind in ("release", "debug")]
    program = next((path for path in found if path.is_file()), None)
    return program or fail("pbr-vr is not built: run `cargo build --release`, or give --program FILE")


def run(command):
    """Runs a child to its end; what it says is shown only where it fails."""
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        fail(f"{command[0]} ended with {done.returncode}:\n{done.stdout.decode(errors='replace').strip()[-2000:]}")


def read_mtl(path):
    """Materials by name: the keys that pbr-vr reads (but no `bump`), maps as absolute names; `map_ao` also where it is written map_Ka."""
    materials, current = {}, None
    for line in path.read_text(errors="replace").splitlines():
        key, _, value = line.strip().partition(" ")
        key, value = key.lower(), value.strip()
        if key == "newmtl":
            current = materials.setdefault(value, {})
        elif current is not None and key in ("kd", "ks", "ns", "pm", "pr"):
            current[key] = [float(word) for word in value.split()]
        elif current is not None and key in ("map_kd", "map_pm", "map_pr", "norm", "map_ao", "map_ka", "map_d"):
            current[key] = str(path.parent / value.split()[-1].strip('"').replace("\\", "/"))
    for material in materials.values():
        ambient = material.pop("map_ka", None)
        # Many exporters repeat the colour there.
        if ambient is not None and ambient != material.get("map_kd"):
            material.setdefault("map_ao", ambient)
        specular, exponent = material.pop("ks", None), material.pop("ns", None)
        if "map_pr" not in material:
            material.setdefault("pr", [roughness_of_phong(specular, exponent)])
    return materials


def roughness_of_phong(specular, exponent):
    """As pbr-vr takes it where a material has no key of its own for it."""
    if specular is not None and not any(specular):
        return 1.0
    return (2 / (max(exponent[0], 0.0) + 2)) ** 0.25 if exponent else 0.5


def resolve(file, folder):
    """A scene's file name, as pbr-vr reads it."""
    if file.startswith(LARGE_SCENES):
        large = os.environ.get("PBR_VR_SCENES") or str(ROOT / "assets" / "downloaded")
        return Path(large) / file.removeprefix(LARGE_SCENES)
    return (folder / file.replace("\\", "/")).resolve()


def read_model(model, folder):
    path = resolve(model["file"], folder)
    if not path.is_file():
        fail(f"{path}: not there; set PBR_VR_SCENES to the folder that holds large scenes, or see tools/fetch-assets --list")
    materials = {}
    for line in path.read_text(errors="replace").splitlines():
        if line.startswith("mtllib"):
            materials.update(read_mtl(path.parent / line.split(None, 1)[1].strip()))
    defaults = {"translation": [0, 0, 0], "rotation_degrees": [0, 0, 0], "scale": 1.0}
    return {**defaults, **model, "file": str(path), "materials": materials}


def read_scene(path, camera):
    if not path.is_file():
        fail(f"{path}: no such scene")
    scene = tomllib.loads(path.read_text())
    if "environment" not in scene or not scene.get("camera"):
        fail(f"{path}: it needs an environment and a camera of its own")
    cameras = {entry["name"]: {"vertical_fov_degrees": 45, **entry} for entry in scene["camera"]}
    if camera is not None and camera not in cameras:
        fail(f"{path}: no camera `{camera}`; there are {', '.join(cameras)}")
    environment = {"rotation_degrees": 0, **scene["environment"]}
    return {
        "models": [read_model(model, path.parent) for model in scene.get("model", [])],
        "lights": scene.get("light", []),
        "environment": {**environment, "panorama": str(resolve(environment["panorama"], path.parent))},
        "camera": cameras[camera] if camera else next(iter(cameras.values())),
    }


def fresnel_of_glass(cosine):
    """Share of unpolarised light that an index of refraction of 1.5 reflects: Fresnel's equations."""
    refracted = math.sqrt(1 - (1 - cosine**2) / 1.5**2)
    across = (cosine - 1.5 * refracted) / (cosine + 1.5 * refracted)
    along = (1.5 * cosine - refracted) / (1.5 * cosine + refracted)
    return (across**2 + along**2) / 2


def reflected_by_dielectric(cosine, roughness, side=24):
    """Share of even light that GGX reflects towards n.v = cosine, single scattering, as Cycles' nodes have it: with Fresnel's
    equations. So a white dielectric reflects all light there, as ours does, whose Fresnel is Schlick's.

    Mean of F G2 / G1 over normals that the eye sees (Heitz, "Sampling the GGX Distribution of Visible Normals" (2018), eq. 19 and
    the sampling of its section 3), at side x side places."""
    cosine, a2 = max(cosine, 1e-4), roughness**4
    v = (math.sqrt(1 - min(cosine, 1.0) ** 2), 0.0, cosine)

    def lambda_of(c):
        return 0.5 * (math.sqrt(1 + a2 * (1 / (c * c) - 1)) - 1)

    stretched = (roughness**2 * v[0], v[2])
    length = math.hypot(*stretched)
    x, z = stretched[0] / length, stretched[1] / length
    total = 0.0
    for i in range(side):
        for j in range(side):
            r, phi = math.sqrt((i + 0.5) / side), 2 * math.pi * (j + 0.5) / side
            t1, t2 = r * math.cos(phi), r * math.sin(phi)
            t2 = 0.5 * (1 - z) * math.sqrt(max(1 - t1 * t1, 0)) + 0.5 * (1 + z) * t2
            up = math.sqrt(max(1 - t1 * t1 - t2 * t2, 0))
            # Across the eye's plane t1, in it t2 and up; then unstretched.
            h = (roughness**2 * (up * x - t2 * z), roughness**2 * t1, max(up * z + t2 * x, 1e-9))
            norm = math.sqrt(sum(c * c for c in h))
            vh = (v[0] * h[0] + v[2] * h[2]) / norm
            nl = 2 * vh * h[2] / norm - v[2]
            if nl > 0:
                total += fresnel_of_glass(min(vh, 1.0)) * (1 + lambda_of(cosine)) / (1 + lambda_of(cosine) + lambda_of(nl))
    return total / side**2


def left_by_specular(width=64, height=16):
    """What the specular part leaves to the diffuse part: columns n.v from 0 to 1, rows roughness from 0 to 1."""
    grey = [1 - reflected_by_dielectric(x / (width - 1), y / (height - 1)) for y in range(height) for x in range(width)]
    return {"width": width, "height": height, "grey": grey}


def blender(job, folder, name):
    file = folder / f"{name}.job.json"
    file.write_text(json.dumps(job, indent=1))
    script = ROOT / "tools" / "cycles_scene.py"
    # Blender ends with 0 even where its script fails, unless told a code.
    run(["blender", "--background", "--factory-startup", "--python-exit-code", "3", "--python", script, "--", file])
    return file


def picture(scene, name, arguments, folder, table):
    """Renders one picture, unless it is there; returns its times. `arguments`: pixels, samples, scattering."""
    output, facts = folder / f"{name}.exr", folder / f"{name}.json"
    job = {
        **scene,
        **{"unoccluded": True, "principled": False, "bounces": 0, "seed": 0},
        **PICTURES[name],
        "output": str(output),
        "facts": str(facts),
        "size": arguments.pixels,
        "samples": arguments.samples,
        "distribution": "MULTI_GGX" if arguments.scattering == "multiple" else "GGX",
        "left_by_specular": table,
    }
    made_by = folder / f"{name}.job.json"
    if not (output.is_file() and facts.is_file() and made_by.is_file() and json.loads(made_by.read_text()) == job):
        facts.unlink(missing_ok=True)
        blender(job, folder, name)
    return json.loads(facts.read_text())


def is_processor(gpu):
    return "llvmpipe" in gpu


def compare(program, folder, a, b):
    maps, report = folder / f"{a}-{b}", folder / f"{a}-{b}.json"
    run([program, "compare", folder / f"{a}.exr", folder / f"{b}.exr", "--maps", maps, "--json", report])
    return json.loads(report.read_text())


def size_of(text):
    sides = text.split("x")
    if len(sides) != 2 or not all(side.isdecimal() and int(side) > 0 for side in sides):
        fail(f"--size {text}: not like 320x240")
    return [int(side) for side in sides]
