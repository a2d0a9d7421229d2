"""A real Chromium for tests: found on the PATH, driven by Playwright, WebGL2 on SwiftShader."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

NAMES = "chromium", "chromium-browser", "google-chrome"

ARGUMENTS = "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"


def chromium() -> str:
    """Path of a Chromium; skips the test where there is none, and fails it in CI, where `make browser` installs it."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None and os.environ.get("CI"):
        pytest.fail("no Chromium on the PATH: `make browser` installs it", pytrace=False)
    if found is None:
        pytest.skip("no Chromium on the PATH: `make browser` installs it")
    return found


@contextmanager
def started() -> Iterator[Any]:
    """Run a headless Chromium: Playwright's `Browser`."""
    path = chromium()
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield browser
        browser.close()
