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
  window.engine = new rsibr.Engine(canvas.getContext("webgl2"), bundle);
}
"""

BASE64 = """
() => {
  window.base64 = (numbers) => {
    const bytes = new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);
    let text = "";
    for (let k = 0; k < bytes.length; k += 8192) text += String.fromCharCode(...bytes.subarray(k, k + 8192));
    return btoa(text);
  };
}
"""


class EnginePage:
    """An engine that runs in a page."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.page.evaluate(BASE64)
        self.page.evaluate(START)

    def ask(self, code: str, *arguments: Any) -> Any:
        """Value of a JavaScript function of the arguments."""
        return self.page.evaluate(code, list(arguments))

    def numbers(self, code: str, *arguments: Any) -> Any:
        """Single numbers that a JavaScript function returns as a typed array."""
        text = self.ask(f"async (given) => base64(await ({code})(given))", *arguments)
        return np.frombuffer(base64.b64decode(text), np.float32)

    def map(self, method: str, frame: Any, size: int) -> Any:
        """Pixels of a map, (N, N, 3)."""
        code = "([method, frame, size]) => engine.read(engine.map(method, frame, size))"
        return self.numbers(code, method, columns(frame), size).reshape(size, size, 3)


def columns(frame: Any) -> list[float]:
    """Nine numbers of a frame as the engine takes it."""
    return np.asarray(frame).T.ravel().tolist()


def html(bundle: Any) -> str:
    """The bare page of a bundle."""
    return (
        "<!doctype html><meta charset=utf-8><title>engine</title>"
        f"{bundle.to_script()}<script>{engine_script()}</script>"
    )


@contextmanager
def engine_page(browser, bundle, folder):
    """Open a bare page of a bundle from the disk; see `opened`."""
    file = folder / "engine.html"
    file.write_text(html(bundle), encoding="utf-8")
    with opened(browser, file) as page:
        yield page


@contextmanager
def opened(browser, file):
    """Open a page from the disk, with an engine of the test's own on its bundle; an error in it fails the test."""
    page, errors = browser.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        page.goto(file.as_uri())
        yield EnginePage(page)
    finally:
        page.close()
    assert not errors, errors


def relative_error(found, wanted, coverage):
    """RelMSE over the texels of which at least half lies inside the disk."""
    inside = coverage >= 0.5
    a, b = found[inside].astype(np.float64), wanted[inside].astype(np.float64)
    return float(((a - b) ** 2 / (b**2 + (0.1 * b.mean(axis=0)) ** 2)).mean())
