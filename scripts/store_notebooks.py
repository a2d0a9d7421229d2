"""Store executed notebooks in `notebooks/`: small pictures, a picture for a page, no progress, times or machine paths.

Run `python scripts/store_notebooks.py out/notebooks` after `make notebooks`. The site shows what is stored.
"""

from __future__ import annotations

import argparse
import base64
import html
import io
import json
import re
from pathlib import Path
from typing import Any

from PIL import Image

from rsibr.publishing.progress.notebook import MARK

ROOT = Path(__file__).resolve().parent.parent
COLOURS = 256
PNG = "image/png"
ADDRESS = re.compile(r" at 0x[0-9a-f]+(?=>)")
"""Of an object in memory."""


def main() -> None:
    """Parse the command line, and store every notebook of the folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of executed notebooks")
    for file in sorted(parser.parse_args().folder.glob("*.ipynb")):
        stored = ROOT / "notebooks" / file.name
        notebook = stored_form(json.loads(file.read_text(encoding="utf-8")))
        stored.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def stored_form(notebook: dict[str, Any]) -> dict[str, Any]:
    """Return the notebook as it is stored."""
    for cell in notebook["cells"]:
        cell["metadata"].pop("execution", None)
        if "outputs" in cell:
            cell["outputs"] = [output for output in cell["outputs"] if not _is_progress(output)]
        for output in cell.get("outputs", ()):
            _clean(output)
    notebook["metadata"]["language_info"] = {"name": "python"}
    return notebook


def _is_progress(output: dict[str, Any]) -> bool:
    """Whether an output was of use only while the cell ran."""
    return MARK in "".join(output.get("data", {}).get("text/html", ()))


def _clean(output: dict[str, Any]) -> None:
    data = output.get("data", {})
    if "".join(data.get("text/html", ())).startswith("<iframe"):
        data["text/html"] = still("".join(data["text/html"]))
    if PNG in data:
        data[PNG] = smaller(data[PNG])
    for text in (output, data):
        for key in ("text", "text/plain"):
            if key in text:
                text[key] = [ADDRESS.sub("", line.replace(f"{ROOT}/", "")) for line in text[key]]


def still(frame: str) -> str:
    """Picture in place of an interactive page, which takes more than a megabyte: the one it shows without WebGL2."""
    found = re.search(r'<img id="still" src="([^"]+)" alt="([^"]+)">', html.unescape(frame))
    if found is None:
        raise SystemExit("a page without a still picture cannot be stored")
    picture, text = found.groups()
    return f'<img src="{picture}" alt="{text}"><br><i>{text}; run the cell for the page.</i>'


def smaller(png: str) -> str:
    """The same picture with a palette, where that is smaller; PNG in base64."""
    picture = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    stream = io.BytesIO()
    picture.quantize(COLOURS, dither=Image.Dither.FLOYDSTEINBERG).save(stream, "PNG", optimize=True)
    small = base64.b64encode(stream.getvalue()).decode()
    return min(png.replace("\n", ""), small, key=len)


if __name__ == "__main__":
    main()
