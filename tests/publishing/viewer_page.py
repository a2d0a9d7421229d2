"""The page of `rsibr view` opened from the disk, watched for errors and for requests."""

from __future__ import annotations

import base64
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

PIXELS = """
async () => {
  const { viewer } = rsibr;
  await viewer.settled();
  viewer.draw();
  const { gl } = viewer.stage, width = gl.drawingBufferWidth, height = gl.drawingBufferHeight;
  const pixels = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let text = "";
  for (let k = 0; k < pixels.length; k += 8192) text += String.fromCharCode(...pixels.subarray(k, k + 8192));
  return [width, height, btoa(text)];
}
"""

SCROLL = """
async (selector) => {
  document.querySelector(selector).scrollIntoView({ block: "start" });
  const frame = document.getElementById("frame"), isKnown = () => {
    const { top, bottom } = frame.getBoundingClientRect();
    return rsibr.viewer.visible === (bottom > 0 && top < innerHeight);
  };
  while (!isKnown()) await new Promise((next) => requestAnimationFrame(next));
}
"""


class ViewerPage:
    """A page whose viewer runs."""

    def __init__(self, page: Any) -> None:
        self.page = page

    def ask(self, script: str, argument: Any = None) -> Any:
        """Value of a function of JavaScript."""
        return self.page.evaluate(script, argument)

    def set(self, **changes: Any) -> None:
        """Change the state, and wait until it is on the canvas."""
        self.page.evaluate("async (changes) => { rsibr.viewer.set(changes); await rsibr.viewer.settled(); }", changes)

    def scroll(self, selector: str) -> None:
        """Scroll to an element, and wait until the page knows whether its picture is in sight."""
        self.page.evaluate(SCROLL, selector)

    def home(self) -> None:
        """Picture in sight, first view, one method and map, linear tone."""
        self.scroll("#frame")
        self.page.evaluate("() => rsibr.viewer.home()")
        maps = {"method": "cabral1999", "against": "", "lookup": "map-reflection", "size": 128}
        self.set(**maps, wipe=0.5, tone="linear", show="picture", exposure=0)

    def pixels(self) -> np.ndarray:
        """The picture, (H, W, 4), row 0 at the top."""
        width, height, text = self.page.evaluate(PIXELS)
        return np.frombuffer(base64.b64decode(text), np.uint8).reshape(height, width, 4)[::-1].astype(int)


@contextmanager
def viewer_page(browser: Any, file: Path, width: int = 1280, height: int = 720, before: str = "", starts: bool = True):
    """Open a page; an error in it, or a request, fails the test."""
    context = browser.new_context(viewport={"width": width, "height": height}, reduced_motion="reduce")
    page, wrong = context.new_page(), []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda told: wrong.append(told.text) if told.type in ("error", "warning") else None)
    page.on("request", lambda asked: wrong.append(asked.url) if not _is_own(asked.url, file) else None)
    if before:
        page.add_init_script(before)
    try:
        page.goto(file.as_uri())
        if starts:
            page.evaluate("async () => { await rsibr.ready; await rsibr.viewer.settled(); }")
        yield ViewerPage(page)
    finally:
        context.close()
    wrong = [one for one in wrong if "GPU stall due to ReadPixels" not in one]  # of the test itself
    assert not wrong, wrong


def _is_own(url: str, file: Path) -> bool:
    return url == file.as_uri() or url.startswith(("data:", "blob:"))
