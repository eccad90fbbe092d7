# One of our scenes in Blender's Cycles: the same camera, panorama, lamps and materials. Run by tools/cycles-reference.
"""blender --background --factory-startup --python tools/cycles_scene.py -- JOB.json

How our conventions map onto Blender's (3.4), each of them checked by a picture in which the two must agree:
- Space: ours is +Y up, Blender's +Z up; everything is turned by +90 degrees about X: (x, y, z) becomes (x, -z, y).
- Panorama: ours has u = atan2(d.z, d.x)/2pi + 0.5. Blender's u = -atan2(b.y, b.x)/2pi + 0.5 is the same under that turn.
- rotation_degrees turns the panorama counter-clockwise seen from above, +Z in Blender; directions are looked up turned back.
- Point light: intensity I in W/sr is a power of 4 pi I.
- Camera: vertical field of view; box filter of one pixel, as our multisampling has.
- Materials: Principled BSDF with Specular 0.5 (F0 = 0.04), GGX, roughness squared to alpha in both; the factors multiply the
  maps; normal maps are OpenGL (+Y up), MikkTSpace; colours sRGB, everything else as it is; texture v upwards in both.
- Exposure: none; both write linear radiance."""

import json
import math
import sys
import time
from pathlib import Path

import bpy
from mathutils import Euler, Matrix, Vector

TURN = Matrix.Rotation(math.radians(90), 4, "X")


def read_mtl(path):
    """Materials by name: the keys that our program reads, as written."""
    materials, current = {}, None
    for line in path.read_text(errors="replace").splitlines():
        key, _, value = line.strip().partition(" ")
        key, value = key.lower(), value.strip()
        if key == "newmtl":
            current = materials.setdefault(value, {})
        elif current is not None and key in ("kd", "pm", "pr"):
            current[key] = [float(word) for word in value.split()]
        elif current is not None and key in ("map_kd", "map_pm", "map_pr", "norm", "map_ao", "map_ka"):
            current[key] = path.parent / value.split()[-1].strip('"').replace("\\", "/")
    return materials


class Builder:
    """The nodes of one material."""

    def __init__(self, material, keys):
        material.use_nodes = True
        self.tree, self.keys = material.node_tree, keys
        self.tree.nodes.clear()

    def node(self, kind, **values):
        node = self.tree.nodes.new(kind)
        for name, value in values.items():
            setattr(node, name, value)
        return node

    def link(self, source, target):
        self.tree.links.new(source, target)

    def image(self, key, space):
        """The colour output of a map, or None."""
        path = self.keys.get(key)
        if path is None:
            return None
        node = self.node("ShaderNodeTexImage", interpolation="Linear", extension="REPEAT")
        node.image = bpy.data.images.load(str(path), check_existing=True)
        node.image.colorspace_settings.name = space
        node.image.alpha_mode = "CHANNEL_PACKED"
        return node.outputs["Color"]

    def scaled(self, image, factor):
        """A grey map's red, times a factor."""
        split = self.node("ShaderNodeSeparateColor")
        self.link(image, split.inputs[0])
        product = self.node("ShaderNodeMath", operation="MULTIPLY")
        self.link(split.outputs[0], product.inputs[0])
        product.inputs[1].default_value = factor
        return product.outputs[0]

    def scalar(self, key, map_key, default, target):
        image = self.image(map_key, "Non-Color")
        factor = self.keys.get(key, [1.0 if image else default])[0]
        if image is None:
            target.default_value = factor
        else:
            self.link(self.scaled(image, factor), target)

    def colour(self, target):
        image = self.image("map_kd", "sRGB")
        factor = (self.keys.get("kd", [1.0 if image else 0.8]) * 3)[:3]
        if image is None:
            target.default_value = (*factor, 1.0)
            return
        product = self.node("ShaderNodeVectorMath", operation="MULTIPLY")
        self.link(image, product.inputs[0])
        product.inputs[1].default_value = factor
        self.link(product.outputs[0], target)

    def occluded(self, closure):
        """The closure times the occlusion map: what our program does to light from the panorama."""
        repeats_colour = self.keys.get("map_ka") == self.keys.get("map_kd")
        key = "map_ao" if "map_ao" in self.keys or repeats_colour else "map_ka"
        image = self.image(key, "Non-Color")
        if image is None:
            return closure
        mix = self.node("ShaderNodeMixShader")
        self.link(self.scaled(image, 1.0), mix.inputs[0])
        black = self.node("ShaderNodeEmission")
        black.inputs["Strength"].default_value = 0.0
        self.link(black.outputs[0], mix.inputs[1])
        self.link(closure, mix.inputs[2])
        return mix.outputs[0]

    def build(self, job):
        principled = self.node("ShaderNodeBsdfPrincipled", distribution=job["distribution"])
        principled.inputs["Specular"].default_value = 0.5
        self.colour(principled.inputs["Base Color"])
        self.scalar("pm", "map_pm", 0.0, principled.inputs["Metallic"])
        self.scalar("pr", "map_pr", 0.5, principled.inputs["Roughness"])
        image = self.image("norm", "Non-Color")
        if image is not None:
            normal = self.node("ShaderNodeNormalMap", space="TANGENT")
            self.link(image, normal.inputs["Color"])
            self.link(normal.outputs[0], principled.inputs["Normal"])
        closure = principled.outputs[0]
        output = self.node("ShaderNodeOutputMaterial")
        self.link(self.occluded(closure) if job["unoccluded"] else closure, output.inputs["Surface"])


def add_model(model, folder, job):
    path = (folder / model["file"].replace("\\", "/")).resolve()
    before = set(bpy.data.objects)
    # No change of axes here: the matrix below makes all of them.
    bpy.ops.wm.obj_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    keys = {}
    for line in path.read_text(errors="replace").splitlines():
        if line.startswith("mtllib"):
            keys.update(read_mtl(path.parent / line.split(None, 1)[1].strip()))
    angles = [math.radians(angle) for angle in model.get("rotation_degrees", [0, 0, 0])]
    # Intrinsic X, Y, Z as ours is: Blender's Euler order is read from the other end.
    world_from_local = (
        Matrix.Translation(model.get("translation", [0, 0, 0]))
        @ Euler(angles, "ZYX").to_matrix().to_4x4()
        @ Matrix.Scale(model.get("scale", 1.0), 4)
    )
    for added in set(bpy.data.objects) - before:
        added.matrix_world = TURN @ world_from_local
        if job["unoccluded"]:
            for ray in ("diffuse", "glossy", "transmission", "shadow"):
                setattr(added, f"visible_{ray}", False)
    for material in bpy.data.materials:
        if not material.get("made"):
            material["made"] = True
            Builder(material, keys.get(material.name.split(".0")[0], {})).build(job)


def add_light(light):
    point = light["point"]
    lamp = bpy.data.lights.new("point", "POINT")
    peak = max(point["intensity"])
    lamp.energy = 4 * math.pi * peak
    lamp.color = [channel / peak if peak else 0.0 for channel in point["intensity"]]
    lamp.shadow_soft_size = 0.0
    placed = bpy.data.objects.new("point", lamp)
    placed.location = TURN @ Vector(point["position"])
    bpy.context.scene.collection.objects.link(placed)


def add_world(environment, folder):
    world = bpy.data.worlds.new("panorama")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    where = nodes.new("ShaderNodeTexCoord")
    turn = nodes.new("ShaderNodeMapping")
    turn.vector_type = "POINT"
    turn.inputs["Rotation"].default_value = (0, 0, -math.radians(environment.get("rotation_degrees", 0)))
    picture = nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(str((folder / environment["panorama"]).resolve()))
    picture.image.colorspace_settings.name = "Linear"
    picture.interpolation = "Linear"
    background, output = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    links.new(where.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs[0], picture.inputs["Vector"])
    links.new(picture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs[0], output.inputs["Surface"])
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = 2048


def add_camera(camera):
    lens = bpy.data.cameras.new(camera["name"])
    lens.sensor_fit = "VERTICAL"
    lens.sensor_height = 24
    lens.lens = 12 / math.tan(math.radians(camera["vertical_fov_degrees"]) / 2)
    lens.clip_start, lens.clip_end = 0.001, 1e5
    placed = bpy.data.objects.new(camera["name"], lens)
    position, target = (TURN @ Vector(camera[key]) for key in ("position", "target"))
    placed.location = position
    placed.rotation_euler = (target - position).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(placed)
    bpy.context.scene.camera = placed


def settle(job):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["size"]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = job["output"]
    scene.view_settings.view_transform = "Raw"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = job["samples"]
    cycles.seed = job["seed"]
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.light_sampling_threshold = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    bounces = job["bounces"]
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = bounces


def main():
    job = json.loads(Path(sys.argv[sys.argv.index("--") + 1]).read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="cycles")
    folder = Path(job["folder"])
    for model in job["models"]:
        add_model(model, folder, job)
    for light in job["lights"]:
        add_light(light)
    add_world(job["environment"], folder)
    add_camera(job["camera"])
    settle(job)
    started, processor = time.monotonic(), time.process_time()
    bpy.ops.render.render(write_still=True)
    facts = {
        "seconds": time.monotonic() - started,
        "processor_seconds": time.process_time() - processor,
        "version": bpy.app.version_string,
    }
    Path(job["facts"]).write_text(json.dumps(facts))


main()
