# One of our scenes in Blender's Cycles: the same camera, panorama, point lights and materials. Run by tools/cycles-reference.
"""blender --background --factory-startup --python tools/cycles_scene.py -- JOB.json

How our conventions map onto Blender's (3.4), each of them checked by a picture in which the two must agree:
- Space: ours is +Y up, Blender's +Z up; everything is turned by +90 degrees about X: (x, y, z) becomes (x, -z, y).
- Panorama: ours has u = atan2(d.z, d.x)/2pi + 0.5. Blender's u = -atan2(b.y, b.x)/2pi + 0.5 is the same under that turn.
- rotation_degrees turns the panorama counter-clockwise seen from above, +Z in Blender; directions are looked up turned back.
- Point light: intensity I in W/sr is a power of 4 pi I. A radius r > 0 is Blender's radius: a disc that faces what it lights, of
  radiance I / (pi r^2), where ours is a sphere of the same; near by (r / distance)^2 of the light is between them. Seen by nothing.
- Probes of a scene are ours alone: Cycles has no need of them.
- Cutouts: transparent where map_d's red is below 0.5. Faces have two sides in both.
- Camera: vertical field of view; box filter of one pixel, as our multisampling has.
- Textures: bilinear; normal maps OpenGL (+Y up), MikkTSpace; colours sRGB, everything else as it is; v upwards in both; the
  factors multiply the maps.
- Specular part: Principled, all metal, its base colour F0: one of 0.04 and one of the albedo, mixed by the metalness, which is ours
  with F0 mixed. So Fresnel is taken at the half vector, from F0 to 1 as in ours; in between it follows a dielectric of index 1.5,
  where ours is Schlick's. GGX, alpha = roughness squared in both. Single scattering: Cycles masks towards light and eye separately,
  ours height-correlated. Multiple scattering of the metal's part only: a dielectric's is less than 0.5 %, and beside a diffuse part
  Blender's adds 1.6 % that it has not when alone (its probability is an estimate).
- Diffuse part: Lambert times what the specular part leaves towards the eye, from a table in the job. Ours takes the same share
  at the light's side too, which no node can know; under even light both are one.
- `principled` instead of these two: Blender's own mixture (Specular 0.5, Burley's diffuse, which takes nothing for the specular).
- Occlusion map: it dims what the panorama gives, not the point lights; only where nothing else shades. So these two lights are rendered
  apart and added. Where things shade, ours ignores these maps, too.
- Nothing is clamped, filtered or left out: caustics on, no denoiser, no least light, roulette unbiased.
- Exposure: none; both write linear radiance."""

import json
import math
import re
import sys
import time
from array import array
from pathlib import Path

import bpy
from mathutils import Euler, Matrix, Vector

TURN = Matrix.Rotation(math.radians(90), 4, "X")


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

    def maths(self, operation, *inputs):
        """A scalar node of sockets and numbers."""
        node = self.node("ShaderNodeMath", operation=operation)
        for socket, value in zip(node.inputs, inputs):
            self.feed(value, socket)
        return node.outputs[0]

    def feed(self, value, socket):
        if isinstance(value, bpy.types.NodeSocket):
            self.link(value, socket)
        else:
            socket.default_value = value

    def scalar(self, key, map_key, default):
        """A grey map's red times its factor, or the factor."""
        image = self.image(map_key, "Non-Color")
        factor = self.keys.get(key, [1.0 if image else default])[0]
        if image is None:
            return factor
        split = self.node("ShaderNodeSeparateColor")
        self.link(image, split.inputs[0])
        return self.maths("MULTIPLY", split.outputs[0], factor)

    def mixed(self, first, second, share):
        node = self.node("ShaderNodeMixRGB")
        for value, socket in ((share, 0), (first, 1), (second, 2)):
            self.feed(value, node.inputs[socket])
        return node.outputs[0]

    def colour(self):
        image = self.image("map_kd", "sRGB")
        factor = (self.keys.get("kd", [1.0 if image else 0.8]) * 3)[:3]
        product = self.node("ShaderNodeVectorMath", operation="MULTIPLY")
        self.feed(image or (1.0, 1.0, 1.0), product.inputs[0])
        product.inputs[1].default_value = factor
        return product.outputs[0]

    def normal(self):
        image = self.image("norm", "Non-Color")
        if image is None:
            return self.node("ShaderNodeNewGeometry").outputs["Normal"]
        normal = self.node("ShaderNodeNormalMap", space="TANGENT")
        self.link(image, normal.inputs["Color"])
        return normal.outputs[0]

    def cut_out(self, closure):
        """The closure where the mask is white, else nothing."""
        node = self.node("ShaderNodeMixShader")
        split = self.node("ShaderNodeSeparateColor")
        self.link(self.image("map_d", "Non-Color"), split.inputs[0])
        self.link(self.maths("GREATER_THAN", split.outputs[0], 0.5), node.inputs[0])
        self.link(self.node("ShaderNodeBsdfTransparent").outputs[0], node.inputs[1])
        self.link(closure, node.inputs[2])
        return node.outputs[0]

    def occluded(self, closure):
        """The closure times the occlusion map."""
        image = self.scalar("ao", "map_ao", 1.0)
        mix = self.node("ShaderNodeMixShader")
        self.feed(image, mix.inputs[0])
        black = self.node("ShaderNodeEmission")
        black.inputs["Strength"].default_value = 0.0
        self.link(black.outputs[0], mix.inputs[1])
        self.link(closure, mix.inputs[2])
        return mix.outputs[0]

    def left_by_specular(self, normal, roughness, table):
        """The table's value at n.v and roughness."""
        cosine = self.node("ShaderNodeVectorMath", operation="DOT_PRODUCT")
        self.link(self.node("ShaderNodeNewGeometry").outputs["Incoming"], cosine.inputs[0])
        self.link(normal, cosine.inputs[1])
        place = self.node("ShaderNodeCombineXYZ")
        # From the first texel's centre to the last one's.
        for value, side, socket in ((cosine.outputs["Value"], table.size[0], 0), (roughness, table.size[1], 1)):
            clamped = self.maths("MINIMUM", self.maths("MAXIMUM", value, 0.0), 1.0)
            self.feed(self.maths("MULTIPLY_ADD", clamped, 1 - 1 / side, 0.5 / side), place.inputs[socket])
        look = self.node("ShaderNodeTexImage", interpolation="Linear", extension="EXTEND")
        look.image = table
        self.link(place.outputs[0], look.inputs["Vector"])
        split = self.node("ShaderNodeSeparateColor")
        self.link(look.outputs["Color"], split.inputs[0])
        return split.outputs[0]

    def principled(self, distribution, colour, metallic, roughness, normal):
        node = self.node("ShaderNodeBsdfPrincipled", distribution=distribution)
        node.inputs["Specular"].default_value = 0.5
        names = {"Base Color": colour, "Metallic": metallic, "Roughness": roughness, "Normal": normal}
        for name, value in names.items():
            self.feed(value, node.inputs[name])
        return node.outputs[0]

    def ours(self, job, table):
        """Our specular and diffuse part, as near as nodes come."""
        colour, metallic, roughness = self.colour(), self.scalar("pm", "map_pm", 0.0), self.scalar("pr", "map_pr", 0.5)
        normal = self.normal()
        diffuse = self.node("ShaderNodeBsdfDiffuse")
        self.link(self.mixed((0.0, 0.0, 0.0, 1.0), colour, self.left_by_specular(normal, roughness, table)), diffuse.inputs["Color"])
        self.link(normal, diffuse.inputs["Normal"])
        dielectric, mix = self.node("ShaderNodeAddShader"), self.node("ShaderNodeMixShader")
        self.link(self.principled("GGX", (0.04, 0.04, 0.04, 1.0), 1.0, roughness, normal), dielectric.inputs[0])
        self.link(diffuse.outputs[0], dielectric.inputs[1])
        self.feed(metallic, mix.inputs[0])
        self.link(dielectric.outputs[0], mix.inputs[1])
        self.link(self.principled(job["distribution"], colour, 1.0, roughness, normal), mix.inputs[2])
        return mix.outputs[0]

    def build(self, job, table):
        if job["principled"]:
            roughness, metallic = self.scalar("pr", "map_pr", 0.5), self.scalar("pm", "map_pm", 0.0)
            self.closure = self.principled(job["distribution"], self.colour(), metallic, roughness, self.normal())
        else:
            self.closure = self.ours(job, table)
        self.output = self.node("ShaderNodeOutputMaterial")
        self.occlude(False)

    def occlude(self, by_map):
        closure = self.occluded(self.closure) if by_map and "map_ao" in self.keys else self.closure
        closure = self.cut_out(closure) if "map_d" in self.keys else closure
        self.link(closure, self.output.inputs["Surface"])


def picture_of(width, height, grey):
    """A picture of grey values, from its lowest row up, read as they are."""
    image = bpy.data.images.new("table", width, height, float_buffer=True, is_data=True)
    image.pixels.foreach_set([channel for value in grey for channel in (value, value, value, 1.0)])
    image.pack()
    return image


def add_model(model, job):
    before, materials_before = set(bpy.data.objects), set(bpy.data.materials)
    # No change of axes here: the matrix below makes all of them.
    bpy.ops.wm.obj_import(filepath=model["file"], forward_axis="Y", up_axis="Z")
    angles = [math.radians(angle) for angle in model["rotation_degrees"]]
    # Intrinsic X, Y, Z as ours is: Blender's Euler order is read from the other end.
    world_from_local = (
        Matrix.Translation(model["translation"])
        @ Euler(angles, "ZYX").to_matrix().to_4x4()
        @ Matrix.Scale(model["scale"], 4)
    )
    for added in set(bpy.data.objects) - before:
        added.matrix_world = TURN @ world_from_local
        # Shadows begin where triangles do, as ours.
        added.cycles.shadow_terminator_geometry_offset = added.cycles.shadow_terminator_offset = 0.0
        if job["unoccluded"]:
            for ray in ("diffuse", "glossy", "transmission", "shadow"):
                setattr(added, f"visible_{ray}", False)
    table = picture_of(**job["left_by_specular"])
    builders = []
    for material in set(bpy.data.materials) - materials_before:
        # A name that is taken gets a number: brass.001.
        name = re.sub(r"\.\d{3}$", "", material.name)
        if name not in model["materials"]:
            raise SystemExit(f"{model['file']}: no material `{name}`")
        builders.append(Builder(material, model["materials"][name]))
        builders[-1].build(job, table)
    return builders


def add_light(description):
    point = description["point"]
    light = bpy.data.lights.new("point", "POINT")
    peak = max(point["intensity"])
    light.energy = 4 * math.pi * peak
    light.color = [channel / peak if peak else 0.0 for channel in point["intensity"]]
    light.shadow_soft_size = point.get("radius", 0.0)
    placed = bpy.data.objects.new("point", light)
    placed.location = TURN @ Vector(point["position"])
    bpy.context.scene.collection.objects.link(placed)
    return placed


def add_world(environment):
    world = bpy.data.worlds.new("panorama")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    where = nodes.new("ShaderNodeTexCoord")
    turn = nodes.new("ShaderNodeMapping")
    turn.vector_type = "POINT"
    turn.inputs["Rotation"].default_value = (0, 0, -math.radians(environment["rotation_degrees"]))
    picture = nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(environment["panorama"])
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
    scene.view_settings.view_transform = "Raw"
    cycles = scene.cycles
    cycles.device = "CPU"
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
    cycles.transparent_max_bounces = 64


def render(output, samples):
    scene = bpy.context.scene
    scene.render.filepath, scene.cycles.samples = str(output), samples
    bpy.ops.render.render(write_still=True)


def load_linear(file):
    """A picture's red, green, blue and alpha, from the lowest row up, and its width and height. (Blender's Python may lack numpy.)"""
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "Linear"
    pixels, size = array("f", bytes(4 * len(image.pixels))), tuple(image.size)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels, size


def save(pixels, size, file):
    image = bpy.data.images.new("picture", *size, float_buffer=True, is_data=True)
    image.pixels.foreach_set(pixels)
    image.file_format, image.filepath_raw = "OPEN_EXR", str(file)
    image.save()


def render_apart(job, lights, builders):
    """What the panorama gives, dimmed by occlusion maps, plus what the point lights give, not dimmed."""
    output, parts = Path(job["output"]), []
    world = next(node for node in bpy.context.scene.world.node_tree.nodes if node.type == "BACKGROUND")
    for panorama, samples in ((True, job["samples"]), (False, max(job["samples"] // 4, 1))):
        if not panorama and not lights:
            break
        world.inputs["Strength"].default_value = float(panorama)
        for light in lights:
            light.hide_render = panorama
        for builder in builders:
            builder.occlude(panorama)
        render(output, samples)
        pixels, size = load_linear(output)
        parts.append(pixels)
        output.unlink()
    save(array("f", map(sum, zip(*parts))), size, output)


def build(job):
    builders = [builder for model in job["models"] for builder in add_model(model, job)]
    lights = [add_light(light) for light in job["lights"]]
    add_world(job["environment"])
    add_camera(job["camera"])
    settle(job)
    return lights, builders


def shrink(job):
    """Averages squares of pixels: a picture rendered larger, seen through a box filter."""
    (pixels, (width, height)), n = load_linear(job["input"]), job["shrink"]
    small = array("f")
    for y in range(height // n):
        rows = [pixels[4 * width * row : 4 * width * (row + 1)] for row in range(y * n, y * n + n)]
        column_sums = [sum(column) for column in zip(*rows)]
        for x in range(width // n):
            square = column_sums[4 * n * x : 4 * n * (x + 1)]
            small.extend(sum(square[channel::4]) / n**2 for channel in range(4))
    save(small, (width // n, height // n), job["output"])


def main():
    job = json.loads(Path(sys.argv[sys.argv.index("--") + 1]).read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if "shrink" in job:
        return shrink(job)
    bpy.ops.preferences.addon_enable(module="cycles")
    lights, builders = build(job)
    started, processor = time.monotonic(), time.process_time()
    if job["unoccluded"]:
        render_apart(job, lights, builders)
    else:
        render(job["output"], job["samples"])
    facts = {
        "seconds": time.monotonic() - started,
        "processor_seconds": time.process_time() - processor,
        "version": bpy.app.version_string,
    }
    Path(job["facts"]).write_text(json.dumps(facts))


main()
