"""Programs of others that read what is published: node with three.js, ktx-parse and Babylon.js; exrheader; Chromium.

They come from `make browser`, and from the system. A test whose program is missing is skipped with the reason, and
fails where `CI=true`.
"""

from __future__ import annotations

import functools
import http.server
import json
import os
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

NODE = Path(__file__).parent / "node"


def missing(what: str) -> None:
    """Skip the test; in CI, where everything is to be there, fail it."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"{what}, and CI=true")
    pytest.skip(what)


def exrheader(file: Path) -> str:
    """What OpenEXR's own program says about a file."""
    program = shutil.which("exrheader")
    if program is None:
        missing("there is no exrheader (Debian: openexr)")
    done = subprocess.run([program, str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def pixels(file: Path) -> np.ndarray:
    """Pixels of an image by OpenImageIO, shape (H, W, C), float32, channels in the order of the file."""
    oiio = pytest.importorskip("OpenImageIO")
    source = oiio.ImageInput.open(str(file))
    assert source, oiio.geterror()
    try:
        return np.asarray(source.read_image("float"))
    finally:
        source.close()


def node(script: str, *arguments: object) -> Any:
    """Result of a script in `node/`: one JSON value on its standard output."""
    program = shutil.which("node")
    if program is None:
        missing("there is no node")
    if not (NODE / "node_modules").is_dir():
        missing("no packages of node: run `make browser`")
    done = subprocess.run(
        [program, str(NODE / script), *map(str, arguments)], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@contextmanager
def page(browser: Any, folder: Path) -> Iterator[Any]:
    """Page of `node/cube.html` in Chromium, which may fetch the files of `folder` as `/files/NAME`."""
    if not (NODE / "node_modules").is_dir():
        missing("no packages of node: run `make browser`")
    with _served(folder) as address:
        opened = browser.new_page()
        try:
            opened.goto(f"{address}/cube.html")
            yield opened
        finally:
            opened.close()


class _Handler(http.server.SimpleHTTPRequestHandler):
    """Files of `node/`, and those to be read."""

    def __init__(self, *arguments: Any, files: Path, **options: Any) -> None:
        self.files = files
        super().__init__(*arguments, **options)

    def translate_path(self, path: str) -> str:
        return (
            str(self.files / path.removeprefix("/files/"))
            if path.startswith("/files/")
            else super().translate_path(path)
        )

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def _served(folder: Path) -> Iterator[str]:
    handler = functools.partial(_Handler, files=folder, directory=str(NODE))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
