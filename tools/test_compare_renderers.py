# Tests tools/compare-renderers without other renderers: its ball, its chart, the EXR writer, which settings of libraries in a browser
# are drawn, and what it says when tools are missing.
import argparse
import contextlib
import importlib.util
import io
import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from importlib.machinery import SourceFileLoader
from pathlib import Path
from unittest import mock

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
                for name, seconds, error in (("pbr-vr open, 4 samples", 0.02, 0.2), ("three.js, 4 samples", 0.05, 0.3),
                                             ("filament.js, 4 samples", 0.1, 0.25), ("Cycles", 20, 0.0))]
        report = {"scene": "ball", "rows": rows}
        with tempfile.TemporaryDirectory() as folder:
            tool.chart([report, {**report, "scene": "room"}], Path(folder), argparse.Namespace(size="4x4", samples=1, rounds=1))
            root = ElementTree.parse(Path(folder) / "renderers.svg").getroot()
        circles = root.findall("{*}circle")
        self.assertEqual(len(circles), 2 * 4 + 4)
        texts = [text.text for text in root.findall("{*}text")]
        for words in ("ball", "room", *(row["name"] for row in rows)):
            self.assertEqual(texts.count(words), 1, words)
        # More time is further right, more error higher up; no error lies on the lowest line.
        ours, three, filament, cycles = ((float(circle.get("cx")), float(circle.get("cy"))) for circle in circles[:4])
        self.assertTrue(ours[0] < three[0] < filament[0] < cycles[0] and three[1] < filament[1] < ours[1] < cycles[1])
        self.assertEqual(cycles[1], tool.TOP + tool.HEIGHT)
        self.assertEqual(len({circle.get("fill") for circle in circles[:4]}), 4)


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


class FakeBrowser:
    """Says what it is asked, and draws one black pixel."""

    asked = []

    def __init__(self, library, job):
        self.name, self.job = library, json.loads(job.read_text())

    def ask(self, command, key, *rest):
        self.asked.append((self.name, command, key, *rest))
        if command == "picture":
            rest[0].write_bytes(bytes(8))
        return {"version": "1", "browser": "b", "driver": "llvmpipe"}


class Libraries(unittest.TestCase):
    def open(self, lights):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        output = Path(folder.name)
        scene = tool.ball(output)
        if lights:
            scene.write_text(scene.read_text() + "[[light]]\npoint = { position = [0, 2, 0], intensity = [1, 1, 1] }\n")
        comparison = tool.Comparison({"libraries": ["three", "filament"]}, scene, argparse.Namespace(output=output, pixels=[1, 1]))
        with mock.patch.object(tool, "Browser", FakeBrowser), mock.patch.object(comparison, "prepare_filament") as prepared:
            FakeBrowser.asked = []
            opened = comparison.open_browsers()
        prepared.assert_called_once_with()
        self.assertEqual(list(opened), [name for name in [*tool.THREE, *tool.FILAMENT] if comparison.picture(name).is_file()])
        return opened, [words for words in FakeBrowser.asked if words[1] == "load"]

    def test_every_setting_is_loaded_under_its_own_key_and_drawn(self):
        opened, loaded = self.open(lights=True)
        self.assertEqual(list(opened), [*tool.THREE, *tool.FILAMENT])
        self.assertEqual(loaded, [("three", "load", 0, 1, "open"), ("three", "load", 1, 4, "open"), ("three", "load", 2, 4, "shadows"),
                                  ("filament", "load", 0, 1, "open"), ("filament", "load", 1, 4, "open")])
        for name, (browser, key) in opened.items():
            samples, shadows = tool.LIBRARIES[browser.name][name]
            self.assertIn((browser.name, "load", key, samples, shadows), loaded)

    def test_without_lamps_there_are_no_shadows_of_them(self):
        opened, _ = self.open(lights=False)
        self.assertEqual(list(opened), [name for name in [*tool.THREE, *tool.FILAMENT] if "shadows" not in name])

    def test_a_job_says_where_filament_finds_its_panorama(self):
        opened, _ = self.open(lights=False)
        ktx = next(iter(opened.values()))[0].job["ktx"]
        self.assertEqual({Path(file).name for file in ktx.values()}, {"filament_ibl.ktx", "filament_skybox.ktx"})

    def test_each_has_a_page_and_one_version(self):
        wanted = json.loads((tool.HERE / "package.json").read_text())["dependencies"]
        for library in tool.LIBRARIES:
            self.assertTrue((tool.HERE / f"{library}_page.js").is_file(), library)
            self.assertRegex(wanted[library], r"^\d+\.\d+\.\d+$")


class Refusals(unittest.TestCase):
    def test_what_is_missing_is_named_with_its_package(self):
        done = subprocess.run([sys.executable, TOOL], capture_output=True, text=True, env={**os.environ, "PATH": os.devnull})
        self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
        self.assertIn("apt-get install blender", done.stderr)

    def libraries_without(self, *absent):
        said = io.StringIO()
        found = mock.patch.object(tool.shutil, "which", lambda name: None if name in absent else f"/usr/bin/{name}")
        with found, mock.patch.object(tool, "fetch_packages", lambda: None), contextlib.redirect_stderr(said):
            return tool.fetch_libraries(), said.getvalue().splitlines()

    def test_without_a_browser_both_libraries_are_left_out_with_the_reason(self):
        libraries, lines = self.libraries_without("chromium", "cmgen")
        self.assertEqual((libraries, len(lines)), ([], 2))
        for library, line in zip(("three.js", "filament.js"), lines):
            self.assertIn(f"{library} is left out: chromium is not installed; on Debian: sudo apt-get install chromium", line)

    def test_without_cmgen_filament_alone_is_left_out(self):
        libraries, lines = self.libraries_without("cmgen")
        self.assertEqual((libraries, len(lines)), (["three"], 1))
        self.assertIn("filament.js is left out: cmgen is not installed; on Debian: sudo apt-get install libfilament-tools", lines[0])

    def test_with_everything_nothing_is_said(self):
        self.assertEqual(self.libraries_without(), (["three", "filament"], []))


if __name__ == "__main__":
    unittest.main()
