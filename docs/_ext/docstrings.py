"""Docstrings as this project writes them, made reStructuredText.

Single backquotes are code: a link where they hold a dotted name of rsibr, and no guess which of several objects of one
short name is meant. A bar is an absolute value and no substitution.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref, pending_xref_condition
from sphinx.application import Sphinx

_CODE = re.compile(r"(?<!`)`(?!`)([^`]+)`(?!`)(?!_)")
_ROLE_BEFORE = re.compile(r":[\w:]+:$")
_LITERAL = re.compile(r"(``.+?``)")
_CLASS = re.compile(r"([A-Z][a-z]\w+)|(\w+\.)+\w+")
_LINKED = re.compile(r"rsibr(\.\w+)+")


def restructured(lines: list[str]) -> list[str]:
    """The lines with single backquotes turned into links or literals, and with bars that stay bars."""
    text = "\n".join(_CODE.sub(_code, paragraph) for paragraph in "\n".join(lines).split("\n"))
    return list(_escaped(text.split("\n")))


def _code(match: re.Match[str]) -> str:
    before, after = match.string[: match.start()], match.string[match.end() :]
    if _ROLE_BEFORE.search(before):
        return match.group()
    code = match.group(1)
    marked = f":py:obj:`{code}`" if _LINKED.fullmatch(code) else f"``{code}``"
    # reStructuredText ends code only before space or punctuation
    return ("\\ " if before[-1:].isalnum() else "") + marked + ("\\ " if after[:1].isalnum() else "")


def _escaped(lines: list[str]) -> Iterator[str]:
    literal_from: int | None = None
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if literal_from is not None and line.strip() and indent <= literal_from:
            literal_from = None
        if literal_from is None and not line.lstrip().startswith((">>>", "...")):
            parts = _LITERAL.split(line)
            line = "".join(p if p.startswith("``") else p.replace("|", r"\|") for p in parts)  # noqa: PLW2901
            if line.rstrip().endswith("::"):
                literal_from = indent
        yield line


def _process(_app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]) -> None:
    lines[:] = restructured(lines)


def _unlink_words(_app: Sphinx, doctree: nodes.document) -> None:
    """Take the links out of words in types: in "bytes, path of a file" none of them is an attribute of a class."""
    for link in list(doctree.findall(pending_xref)):
        if link.get("refspecific") and not _CLASS.fullmatch(link["reftarget"]):
            conditions = [child for child in link.children if isinstance(child, pending_xref_condition)]
            link.replace_self(conditions[0].children if conditions else link.children)


def setup(app: Sphinx) -> dict[str, Any]:
    """Come before napoleon, which reads the sections of the docstrings."""
    app.connect("autodoc-process-docstring", _process, priority=400)
    app.connect("doctree-read", _unlink_words)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
