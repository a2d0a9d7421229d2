"""Notebooks reach for public names, and are stored as a reader wants them."""

from __future__ import annotations

import ast
import importlib.util
import json
from pathlib import Path

import pytest

import rsibr

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))

DEEP = {
    "05_three_systems": {"rsibr.methods.kautz2003", "rsibr.methods.miller1984"},  # their claims, as measured
    "07_capture": {  # photographs made to try a capture with
        "rsibr.capture.cameras.conventions",
        "rsibr.capture.cameras.pinhole",
        "rsibr.capture.exr_parts",
        "rsibr.capture.synth",
        "rsibr.capture.synthetic.rendering",
        "rsibr.capture.synthetic.scenes",
        "rsibr.geometry.frame",
        "rsibr.geometry.projections.latlong",
        "rsibr.geometry.projections.sphere_image",
        "rsibr.scene.config",
        "rsibr.scene.environment",
        "rsibr.scene.material",
        "rsibr.store.atomic",
        "rsibr.validation.reference",
    },
}
"""What each notebook takes from below the public names; all others take nothing."""

MOST_BYTES = 1_100_000
"""Of a stored notebook."""


def cells(file, kind):
    return [cell for cell in json.loads(file.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == kind]


def code(file):
    lines = "".join("".join(cell["source"]) + "\n" for cell in cells(file, "code")).splitlines()
    return ast.parse("\n".join(line for line in lines if not line.startswith("%")))


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_imports_public_names_only(file):
    for node in ast.walk(code(file)):
        if isinstance(node, ast.Import):
            found = {name.name for name in node.names if name.name.startswith("rsibr.")}
            assert not found, f"{file.name}:{node.lineno} imports {found}"
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "rsibr":
            assert node.module in DEEP.get(file.stem, set()), f"{file.name}: {ast.unparse(node)}"


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_names_that_a_notebook_takes_of_rsibr_are_public(file):
    taken = {
        node.attr
        for node in ast.walk(code(file))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "rsibr"
    }
    assert taken <= set(rsibr.__all__)


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_stored_notebook_is_small_and_holds_no_frame_no_progress_and_no_error(file):
    assert file.stat().st_size <= MOST_BYTES
    for cell in cells(file, "code"):
        for output in cell["outputs"]:
            shown = "".join(output.get("data", {}).get("text/html", ()))
            assert "<iframe" not in shown
            assert "rsibr-progress" not in shown
            assert output["output_type"] != "error"


def store():
    spec = importlib.util.spec_from_file_location("store_notebooks", ROOT / "scripts" / "store_notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_storing_drops_progress_and_keeps_a_picture_of_a_page():
    from rsibr.publishing.page.page import Page

    page = Page('<img id="still" src="data:image/png;base64,AA" alt="Still picture of a &#34;paint&#34;">', "A page")
    outputs = [
        {
            "output_type": "display_data",
            "metadata": {},
            "data": {"text/html": ['<span class="rsibr-progress"></span>']},
        },
        {"output_type": "execute_result", "metadata": {}, "data": {"text/html": [page._repr_html_()]}},
        {"output_type": "stream", "name": "stdout", "text": [f"{ROOT}/out/a\n"]},
    ]
    notebook = {"metadata": {}, "cells": [{"cell_type": "code", "metadata": {"execution": {}}, "outputs": outputs}]}
    (cell,) = store().stored_form(notebook)["cells"]
    picture, text = cell["outputs"]
    assert 'src="data:image/png;base64,AA"' in picture["data"]["text/html"]
    assert "iframe" not in picture["data"]["text/html"]
    assert text["text"] == ["out/a\n"]
