# Tests tools/fetch-assets against a server on this machine: resume, checksums, missing files, no network, hostile archives.
import contextlib
import hashlib
import http.server
import importlib.util
import io
import os
import sys
import tempfile
import threading
import unittest
import zipfile
from importlib.machinery import SourceFileLoader
from pathlib import Path

TOOL = Path(__file__).with_name("fetch-assets")


def load_tool():
    loader = SourceFileLoader("fetch_assets", str(TOOL))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("fetch_assets", loader))
    sys.modules["fetch_assets"] = module
    sys.dont_write_bytecode = True
    loader.exec_module(module)
    return module


class Server(http.server.ThreadingHTTPServer):
    """Serves `files`; knows ranges; cuts the next answer short after `cut` bytes."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.files, self.ranges, self.cut = {}, [], None


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        body = self.server.files.get(self.path)
        if body is None:
            self.send_error(404)
            return
        asked = self.headers.get("Range")
        self.server.ranges.append(asked)
        start = int(asked.removeprefix("bytes=").rstrip("-")) if asked else 0
        if asked and start >= len(body):
            self.send_error(416)
            return
        self.send_response(206 if asked else 200)
        self.send_header("Content-Length", str(len(body) - start))
        self.end_headers()
        cut, self.server.cut = self.server.cut, None
        self.wfile.write(body[start:][:cut])

    def log_message(self, *_):
        pass


def zipped(members):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return data.getvalue()


class FetchAssets(unittest.TestCase):
    def setUp(self):
        self.tool = load_tool()
        self.server = Server()
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.addCleanup(self.server.server_close)
        self.addCleanup(self.server.shutdown)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.into = Path(folder.name)
        os.environ.pop("PBR_VR_SCENES", None)
        for name in ("http_proxy", "HTTP_PROXY"):
            os.environ.pop(name, None)

    def serve(self, file, body, sha256="right"):
        self.server.files["/" + file] = body
        checksum = hashlib.sha256(body).hexdigest() if sha256 == "right" else sha256
        self.sources = (f"http://127.0.0.1:{self.server.server_port}/{file}",)
        self.tool.ASSETS = [self.tool.Asset("thing", self.sources, checksum, "a licence")]

    def fetch(self, *arguments):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = self.tool.main(["--into", str(self.into), *arguments])
        return code, out.getvalue(), err.getvalue()

    def test_downloads_checks_and_unpacks(self):
        self.serve("thing.zip", zipped({"a/model.obj": "v 0 0 0"}))
        code, out, err = self.fetch("thing")
        self.assertEqual((code, err), (0, ""))
        self.assertIn("a licence", out)
        self.assertEqual((self.into / "thing/a/model.obj").read_text(), "v 0 0 0")
        code, out, _ = self.fetch("thing")
        self.assertEqual((code, len(self.server.ranges)), (0, 1))
        self.assertIn("already", out)

    def test_goes_on_where_it_broke_off(self):
        body = bytes(range(256)) * 4000
        self.serve("thing.hdr", body)
        self.server.cut = 300_000
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn("broke off after 300000", err)
        code, _, err = self.fetch()
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(self.server.ranges, [None, "bytes=300000-"])
        self.assertEqual((self.into / "thing/thing.hdr").read_bytes(), body)

    def test_takes_a_part_that_was_already_whole(self):
        self.serve("thing.hdr", b"whole")
        (self.into / "thing").mkdir()
        (self.into / "thing/thing.hdr.part").write_bytes(b"whole")
        self.assertEqual(self.fetch()[0], 0)
        self.assertEqual((self.into / "thing/thing.hdr").read_bytes(), b"whole")

    def test_refuses_a_wrong_checksum_and_deletes_the_file(self):
        self.serve("thing.hdr", b"not the right bytes", sha256="0" * 64)
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn("should be " + "0" * 64, err)
        self.assertEqual([f for f in self.into.rglob("*") if f.is_file()], [])

    def test_writes_down_a_checksum_that_nobody_published(self):
        self.serve("thing.hdr", b"first", sha256=None)
        code, out, _ = self.fetch()
        self.assertEqual(code, 0)
        self.assertIn(hashlib.sha256(b"first").hexdigest(), out)
        (self.into / "thing/thing.hdr").unlink()
        self.server.files["/thing.hdr"] = b"second"
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn("should be " + hashlib.sha256(b"first").hexdigest(), err)

    def test_turns_to_the_next_source(self):
        self.serve("moved/thing.hdr", b"bytes")
        first = self.sources[0].replace("/moved", "")
        checksum = hashlib.sha256(b"bytes").hexdigest()
        self.tool.ASSETS = [self.tool.Asset("thing", (first, *self.sources), checksum, "a licence")]
        self.assertEqual(self.fetch()[0], 0)
        self.assertEqual((self.into / "thing/thing.hdr").read_bytes(), b"bytes")

    def test_names_a_missing_file(self):
        self.serve("thing.hdr", b"")
        del self.server.files["/thing.hdr"]
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn("404", err)

    def test_says_in_one_line_that_it_is_offline(self):
        self.serve("thing.hdr", b"")
        self.server.shutdown()
        self.server.server_close()
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn("check the internet connection", err)
        self.assertEqual(err.count("\n"), 1)

    def test_does_not_unpack_outside_its_folder(self):
        self.serve("thing.zip", zipped({"../escaped.txt": "x"}))
        code, _, err = self.fetch()
        self.assertEqual(code, 1)
        self.assertIn("points out of the folder", err)
        self.assertFalse((self.into / "escaped.txt").exists())

    def test_lists_without_downloading(self):
        self.serve("thing.hdr", b"x")
        code, out, _ = self.fetch("--list")
        self.assertEqual((code, self.server.ranges), (0, []))
        self.assertIn("thing.hdr", out)

    def test_names_what_there_is_for_an_unknown_name(self):
        self.serve("thing.hdr", b"x")
        code, _, err = self.fetch("thnig")
        self.assertEqual(code, 1)
        self.assertIn("there are: thing", err)

    def test_says_that_copies_are_there(self):
        self.serve("thing.hdr", b"x")
        os.environ["PBR_VR_SCENES"] = str(self.into)
        self.assertIn(str(self.into), self.fetch("--list")[1])


if __name__ == "__main__":
    unittest.main()
