"""A bare page with a bundle and the engine, and what the tests ask of it in a real browser."""

from __future__ import annotations

import base64
from contextlib import contextmanager
from typing import Any

import numpy as np

from rsibr.publishing.bundle import engine_script

START = """
async () => {
  const bundle = await rsibr.decodeBundle(document.getElementById("rsibr-bundle"));
  window.canvas = document.createElement("canvas");
  const gl = canvas.getContext("webgl2");
  window.engine = new rsibr.Engine(gl, bundle);
}
"""

BASE64 = """
const base64 = (numbers) => {
  const bytes = new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);
  let text = "";
  for (let k = 0; k < bytes.length; k += 8192) text += String.fromCharCode(...bytes.subarray(k, k + 8192));
  return btoa(text);
};
"""

MAP = "([method, frame, size]) => base64(engine.read(engine.map(method, frame, size)))"


class EnginePage:
    """An engine that runs in a page."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.page.evaluate(START)

    def map(self, method: str, frame: Any, size: int) -> Any:
        """Pixels of a map, (N, N, 3)."""
        columns = np.asarray(frame).T.ravel().tolist()
        text = self.page.evaluate(MAP, [method, columns, size])
        return np.frombuffer(base64.b64decode(text), np.float32).reshape(size, size, 3)


def html(bundle: Any) -> str:
    """The bare page of a bundle."""
    return (
        "<!doctype html><meta charset=utf-8><title>engine</title>"
        f"{bundle.to_script()}<script>{BASE64}{engine_script()}</script>"
    )


@contextmanager
def engine_page(browser, bundle, tmp_path):
    """Open the page of a bundle from the disk; an error in it fails the test."""
    file = tmp_path / "engine.html"
    file.write_text(html(bundle), encoding="utf-8")
    page, errors = browser.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        page.goto(file.as_uri())
        yield EnginePage(page)
    finally:
        page.close()
    assert not errors, errors
