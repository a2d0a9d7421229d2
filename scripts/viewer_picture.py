"""The README's picture of `rsibr view`: a page in headless Chromium.

rsibr view out/demo/paint.rsibr --validation out/demo --export out/view.html
python scripts/viewer_picture.py out/view.html --out docs/_static/viewer.jpg
"""

from __future__ import annotations

import argparse
import io
import shutil
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")

STATE = """
async () => {
  const { viewer } = rsibr;
  viewer.setFov(35);
  viewer.set({ against: "blend", background: true, tone: "filmic" });
  await viewer.settled();
  viewer.invalidate(); // a second frame, whose time is that of a frame
  await viewer.settled();
}
"""


def main() -> None:
    """Open a page, compare two methods, and take its picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/_static/viewer.jpg"))
    given = parser.parse_args()
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium(), args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": 1280, "height": 760}, reduced_motion="reduce")
        page.goto(given.page.resolve().as_uri())
        page.evaluate("async () => { await rsibr.ready; }")
        page.evaluate(STATE)
        page.wait_for_timeout(1500)
        picture = page.screenshot()
        browser.close()
    Image.open(io.BytesIO(picture)).convert("RGB").save(given.out, quality=90, optimize=True)


def chromium() -> str:
    """Path of a Chromium, as the tests find it."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        raise SystemExit("no Chromium on the PATH: `make browser` installs it")
    return found


if __name__ == "__main__":
    main()
