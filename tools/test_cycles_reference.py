# Tests tools/cycles-reference and tools/cycles.py without Blender: what it makes of scenes and materials, its table, and what it says when tools are missing.
import importlib.util
import math
import os
import subprocess
import sys
import tempfile
import unittest
from importlib.machinery import SourceFileLoader
from pathlib import Path

import cycles

TOOL = Path(__file__).with_name("cycles-reference")
ROOT = TOOL.parent.parent


def load_tool():
    loader = SourceFileLoader("cycles_reference", str(TOOL))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("cycles_reference", loader))
    sys.dont_write_bytecode = True
    loader.exec_module(module)
    return module


tool = load_tool()


def fresnel(cosine):
    """By the form without the angle of refraction: Cook and Torrance (1982), eq. 4."""
    g = math.sqrt(1.5**2 + cosine**2 - 1)
    a, b = (g - cosine) / (g + cosine), (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    return 0.5 * a * a * (1 + b * b)


class Table(unittest.TestCase):
    def test_a_mirror_reflects_what_fresnel_says(self):
        for cosine in (1.0, 0.7, 0.3, 0.1):
            self.assertAlmostEqual(cycles.reflected_by_dielectric(cosine, 0.0), fresnel(cosine), places=6)

    def test_a_rough_surface_reflects_what_a_plain_sum_over_all_light_finds(self):
        for cosine, roughness in ((1.0, 1.0), (0.6, 0.7), (0.25, 1.0)):
            with self.subTest(cosine=cosine, roughness=roughness):
                self.assertAlmostEqual(cycles.reflected_by_dielectric(cosine, roughness), self.plain_sum(cosine, roughness), delta=3e-4)

    def plain_sum(self, nv, roughness, side=100):
        """F D V n.l over the hemisphere, places of equal solid angle."""
        a2, total = roughness**4, 0.0
        for i in range(side):
            for j in range(side):
                nl, phi = (i + 0.5) / side, math.pi * (j + 0.5) / side
                sine = math.sqrt(1 - nl * nl)
                l, v = (sine * math.cos(phi), sine * math.sin(phi), nl), (math.sqrt(1 - nv * nv), 0.0, nv)
                h = [a + b for a, b in zip(l, v)]
                norm = math.sqrt(sum(c * c for c in h))
                nh, vh = h[2] / norm, norm / 2
                d = a2 / (math.pi * (nh * nh * (a2 - 1) + 1) ** 2)
                v_smith = 0.5 / (nl * math.sqrt(a2 + (1 - a2) * nv * nv) + nv * math.sqrt(a2 + (1 - a2) * nl * nl))
                total += fresnel(vh) * d * v_smith * nl
        return total * 2 * math.pi / side**2

    def test_rows_go_from_smooth_to_rough_and_columns_from_grazing_to_head_on(self):
        table = cycles.left_by_specular(5, 3)
        self.assertEqual(len(table["grey"]), 15)
        self.assertLess(table["grey"][0], 0.01)
        self.assertAlmostEqual(table["grey"][4], 0.96)
        self.assertGreater(table["grey"][10], table["grey"][0])


class Scenes(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def materials(self, text):
        (self.folder / "m.mtl").write_text(text)
        return cycles.read_mtl(self.folder / "m.mtl")

    def test_materials_keep_factors_and_maps_beside_their_file(self):
        read = self.materials("newmtl a\nKd 0.5 0.6 0.7\nPr 0.3\nmap_Kd maps\\a.png\nnewmtl b\nnorm n.png\n")
        a = {"kd": [0.5, 0.6, 0.7], "pr": [0.3], "map_kd": str(self.folder / "maps/a.png")}
        self.assertEqual(read, {"a": a, "b": {"norm": str(self.folder / "n.png"), "pr": [0.5]}})

    def test_roughness_comes_from_phong_where_there_is_none_of_its_own(self):
        cases = {"": 0.5, "Ks 0 0 0": 1.0, "Ks 1 1 1\nNs 30": 0.5, "Ks 0 0 0\nPr 0.2": 0.2}
        for text, expected in cases.items():
            with self.subTest(text):
                self.assertEqual(self.materials(f"newmtl a\n{text}\n"), {"a": {"pr": [expected]}})
        self.assertNotIn("pr", self.materials("newmtl a\nKs 0 0 0\nmap_Pr r.png\n")["a"])

    def test_an_ambient_map_is_occlusion_unless_it_repeats_the_colour(self):
        read = self.materials("newmtl a\nmap_Ka o.png\nmap_Kd c.png\nnewmtl b\nmap_Ka c.png\nmap_Kd c.png\n")
        self.assertEqual(read["a"]["map_ao"], str(self.folder / "o.png"))
        self.assertNotIn("map_ao", read["b"])

    def test_the_shipped_scenes_are_read_with_all_their_materials(self):
        scene = cycles.read_scene(ROOT / "assets/scenes/tearoom.toml", "room")
        self.assertEqual(scene["camera"]["vertical_fov_degrees"], 65)
        [model] = scene["models"]
        self.assertEqual(set(model["materials"]), {"plaster", "wood", "porcelain", "brass", "tea"})
        self.assertTrue(Path(scene["environment"]["panorama"]).is_file())

    def test_large_scenes_are_found_where_the_variable_says(self):
        before = os.environ.get("PBR_VR_SCENES")
        os.environ["PBR_VR_SCENES"] = str(self.folder)
        try:
            self.assertEqual(cycles.resolve("${PBR_VR_SCENES}/a/b.obj", ROOT), self.folder / "a/b.obj")
        finally:
            os.environ.pop("PBR_VR_SCENES")
            if before is not None:
                os.environ["PBR_VR_SCENES"] = before

    def test_only_what_a_picture_names_differs_from_the_picture_before_it(self):
        self.assertEqual(cycles.PICTURES["direct"], {"unoccluded": False})
        self.assertEqual(cycles.PICTURES["noise"], {"seed": 1})
        self.assertEqual(cycles.PICTURES["full-noise"], {**cycles.PICTURES["full"], "seed": 1})
        made = {"exact-fine", *tool.OURS, *cycles.PICTURES}
        self.assertLessEqual({name for pair in tool.PAIRS.values() for name in pair}, made)


class Refusals(unittest.TestCase):
    """Each in one line, and before anything is rendered."""

    def refused(self, *arguments, path=os.devnull):
        environment = {**os.environ, "PATH": path}
        done = subprocess.run([sys.executable, TOOL, *arguments], capture_output=True, text=True, env=environment)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        return done.stderr

    def stand_ins(self):
        """A PATH on which Blender and ImageMagick seem to be."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        for name in ("blender", "montage"):
            file = Path(folder.name) / name
            file.write_text("#!/bin/sh\nexit 1\n")
            file.chmod(0o755)
        return folder.name

    def test_a_missing_blender_is_named_with_its_package(self):
        said = self.refused("assets/scenes/teapot.toml")
        self.assertIn("blender is not installed", said)
        self.assertIn("apt-get install blender", said)

    @unittest.skipIf(os.name == "nt", "stand-ins are shell scripts")
    def test_scenes_cameras_and_sizes_that_do_not_exist_are_named(self):
        teapot = str(ROOT / "assets/scenes/teapot.toml")
        program = ["--program", str(TOOL)]
        cases = [
            ([teapot, "--size", "320"], "--size 320: not like 320x240"),
            (["no.toml", *program], "no.toml: no such scene"),
            ([teapot, "--camera", "roof", *program], "no camera `roof`; there are front, lid"),
            ([teapot, "--program", "nothing"], "pbr-vr is not built"),
        ]
        for arguments, expected in cases:
            with self.subTest(expected), tempfile.TemporaryDirectory() as output:
                self.assertIn(expected, self.refused(*arguments, "-o", output, path=self.stand_ins()))


if __name__ == "__main__":
    unittest.main()
