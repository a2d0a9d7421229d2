"""Math as MathML Core, converted when the site is built: a browser needs neither JavaScript nor a network to show it.

The font, STIX Two Math, comes with the package `ziamath` and is copied beside the pages.
"""

from __future__ import annotations

import re
import shutil
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator

_LOGGER = logging.getLogger(__name__)
_CONVERTER = LatexToMathML(fancy_error=False)
FONT = "STIXTwoMath-Regular.ttf"

_TEXT = re.compile(r"(\\text\w*\{)([^}]*)\}")
_TAG = re.compile(r"\\tag\{([^}]*)\}")


def convert(source: str, *, displaystyle: bool, place: nodes.Node | None = None) -> str:
    """MathML of LaTeX; what cannot be converted is a warning at its place, and stays LaTeX."""
    plain = _TEXT.sub(lambda text: text.group().replace("_", r"\_").replace(r"\\_", r"\_"), source)
    try:
        return str(_CONVERTER.convert_with_local_state(plain, displaystyle=displaystyle))
    except LatexError as error:
        _LOGGER.warning("math cannot be converted: %s: %s", error, source, location=place)
        return f"<code>{nodes.Text(source).astext()}</code>"


def visit_inline(translator: HTML5Translator, node: nodes.math) -> None:
    """Write a formula within a line."""
    translator.body.append(f'<span class="math">{convert(node.astext(), displaystyle=False, place=node)}</span>')
    raise nodes.SkipNode


def visit_block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula of its own, with its number where it has a tag or a label."""
    tag = _TAG.search(node.astext())
    source = _TAG.sub("", node.astext()).strip()
    if ("&" in source or r"\\" in source) and not source.startswith(r"\begin"):
        source = rf"\begin{{aligned}}{source}\end{{aligned}}"
    given = tag.group(1) if tag else get_node_equation_number(translator, node) if node["number"] else ""
    number = f'<span class="eqno">({given})</span>' if given else ""
    body = convert(source, displaystyle=True, place=node)
    translator.body.append(translator.starttag(node, "div", CLASS="math-block"))
    translator.body.append(f'<div class="formula">{body}</div>{number}</div>')
    raise nodes.SkipNode


def copy_font(app: Sphinx, error: Exception | None) -> None:
    """Put the font where `site.css` looks for it."""
    if error is None and app.builder.format == "html":
        with as_file(files("ziamath") / "fonts" / FONT) as font:
            shutil.copyfile(font, Path(app.outdir) / "_static" / FONT)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register as the math renderer of the HTML builders."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    app.config.html_math_renderer = "mathml"
    app.connect("build-finished", copy_font)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
