# Tests tools/compare-renderers without other renderers: its ball, its chart, the EXR writer, and what it says when tools are missing.
import argparse
import importlib.util
import os
import struct
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from importlib.machinery import SourceFileLoader
from pathlib import Path

TOOL = Path(__file__).with_name("compare-renderers")


def load_tool():
    loader = SourceFileLoader("compare_renderers", str(TOOL))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("compare_renderers", loader))
    loader.exec_module(module)
    return module


sys.dont_write_bytecode = True
sys.path.insert(0, str(TOOL.parent))
tool = load_tool()


class Ball(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = tool.ball(Path(folder.name))
        lines = [line.split() for line in (Path(folder.name) / "ball.obj").read_text().splitlines()]
        self.corners = [tuple(map(float, line[1:])) for line in lines if line[0] == "v"]
        self.faces = [[int(corner.split("//")[0]) - 1 for corner in line[1:]] for line in lines if line[0] == "f"]

    def test_it_is_a_scene_with_its_material_and_panorama(self):
        scene = tool.read_scene(self.file, None)
        self.assertEqual(scene["models"][0]["materials"], {"gold": {"kd": [1, 0.766, 0.336], "pm": [1], "pr": [0.3]}})
        self.assertTrue(Path(scene["environment"]["panorama"]).is_file())

    def test_it_is_closed_and_its_faces_look_outwards(self):
        volume = 0.0
        for face in self.faces:
            a, b, c = (self.corners[i] for i in face)
            cross = (b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0])
            part = sum(x * y for x, y in zip(a, cross)) / 6
            self.assertGreater(part, 0)
            volume += part
        self.assertAlmostEqual(volume, 4.18879, delta=0.01)


class Chart(unittest.TestCase):
    def test_every_renderer_has_its_mark_and_a_line_of_the_key(self):
        rows = [{"name": name, "seconds": seconds, "relative_l1": error, "flip": 0.1}
                for name, seconds, error in (("pbr-vr open, 4 samples", 0.02, 0.2), ("three.js, 4 samples", 0.05, 0.3), ("Cycles", 20, 0.0))]
        report = {"scene": "ball", "rows": rows}
        with tempfile.TemporaryDirectory() as folder:
            tool.chart([report, {**report, "scene": "room"}], Path(folder), argparse.Namespace(size="4x4", samples=1, rounds=1))
            root = ElementTree.parse(Path(folder) / "renderers.svg").getroot()
        circles = root.findall("{*}circle")
        self.assertEqual(len(circles), 2 * 3 + 3)
        texts = [text.text for text in root.findall("{*}text")]
        for words in ("ball", "room", *(row["name"] for row in rows)):
            self.assertEqual(texts.count(words), 1, words)
        # More time is further right, more error higher up; no error lies on the lowest line.
        ours, three, cycles = ((float(circle.get("cx")), float(circle.get("cy"))) for circle in circles[:3])
        self.assertTrue(ours[0] < three[0] < cycles[0] and three[1] < ours[1] < cycles[1])
        self.assertEqual(cycles[1], tool.TOP + tool.HEIGHT)


class Exr(unittest.TestCase):
    def test_rows_from_below_become_a_picture_that_stands_upright(self):
        # 2x2, below 1 2, above 3 4; red, green, blue are that times 1, 10 and 100.
        pixels = [part for n in (1, 2, 3, 4) for part in (n, 10 * n, 100 * n, 1)]
        with tempfile.TemporaryDirectory() as folder:
            written = Path(folder) / "a.exr"
            tool.write_exr(written, struct.pack("<16e", *pixels), (2, 2))
            file = written.read_bytes()
        self.assertEqual(struct.unpack("<II", file[:8]), (20000630, 2))
        offsets = struct.unpack("<QQ", file[-2 * (8 + 12) - 16 : -2 * (8 + 12)])
        for y, (row, offset) in enumerate(zip(((3, 4), (1, 2)), offsets)):
            at, size, *values = struct.unpack("<ii6e", file[offset : offset + 20])
            self.assertEqual((at, size), (y, 12))
            self.assertEqual(values, [scale * n for scale in (100, 10, 1) for n in row])


class Refusals(unittest.TestCase):
    def test_what_is_missing_is_named_with_its_package(self):
        done = subprocess.run([sys.executable, TOOL], capture_output=True, text=True, env={**os.environ, "PATH": os.devnull})
        self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
        self.assertIn("apt-get install blender", done.stderr)

    def test_three_js_is_left_out_with_the_reason(self):
        before = os.environ["PATH"]
        os.environ["PATH"] = os.devnull
        self.addCleanup(os.environ.__setitem__, "PATH", before)
        self.assertIn("apt-get install chromium", tool.fetch_three())


if __name__ == "__main__":
    unittest.main()
