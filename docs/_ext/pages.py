"""Pages that are written anew at each build: notebooks beside the other pages, and the reference, a page a package.

The reference lists what is in the folders, so that a new module is on the site without an entry anywhere.
"""

from __future__ import annotations

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

LONG = 32
"""Characters of inline code above which it may break in a table."""

_PUBLIC, _ROOMS, _NOTEBOOKS = "reference/public", "reference/rooms", "notebooks"


def write_pages(app: Sphinx) -> None:
    """Write the pages into the folder of sources, where Sphinx finds them."""
    docs = Path(app.srcdir)
    root = docs.parent
    _refill(docs / _NOTEBOOKS, {file.name: file for file in sorted((root / "notebooks").glob("*.ipynb"))})
    _refill(docs / _PUBLIC, {f"{name}.rst": text for name, text in _public_pages(root / "rsibr")})
    _refill(docs / _ROOMS, {f"{name}.rst": text for name, text in _room_pages(root / "rsibr")})


def _refill(folder: Path, content: dict[str, Path | str]) -> None:
    """Make `folder` hold `content` and nothing else; what has not changed is not touched, lest it is read again."""
    folder.mkdir(parents=True, exist_ok=True)
    for stale in {file.name for file in folder.iterdir()} - set(content):
        (folder / stale).unlink()
    for name, source in content.items():
        target = folder / name
        data = source.read_bytes() if isinstance(source, Path) else source.encode()
        if not target.exists() or target.read_bytes() != data:
            if isinstance(source, Path):
                shutil.copyfile(source, target)
            else:
                target.write_text(source, encoding="utf-8")


def _public_pages(package: Path) -> Iterator[tuple[str, str]]:
    """A page for each name of `rsibr.__all__`, with what is documented of it where it is defined."""
    tree = ast.parse((package / "__init__.py").read_text(encoding="utf-8"))
    constants = {
        node.targets[0].id: ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id in {"_HOME", "_MODULES", "__all__"}
    }
    for name in constants["__all__"]:
        if name in constants["_HOME"]:
            content = f".. currentmodule:: rsibr\n\n{_directive(package, constants['_HOME'][name], name)}"
        elif name in constants["_MODULES"]:
            module = constants["_MODULES"][name]
            content = f"The module `{module}` under a short name.\n\n.. automodule:: {module}\n   :no-index:"
        else:
            continue
        heading = f"rsibr.{name}"
        yield name, f"{heading}\n{'=' * len(heading)}\n\n{content}\n"


def _directive(package: Path, module: str, name: str) -> str:
    """Directive that documents `name` as a part of `rsibr`: a function, a class or a constant."""
    file = package.parent / (module.replace(".", "/") + ".py")
    kinds = {ast.FunctionDef: "autofunction", ast.ClassDef: "autoclass"}
    tree = ast.parse(file.read_text(encoding="utf-8"))
    found = [kinds[type(node)] for node in tree.body if type(node) in kinds and node.name == name]  # type: ignore[attr-defined]
    if found:
        return f".. {found[0]}:: rsibr.{name}"
    return f".. autodata:: {module}.{name}\n   :no-index:"


def _room_pages(package: Path) -> Iterator[tuple[str, str]]:
    """A page for each package: what it is for, then its modules."""
    for init in sorted(package.rglob("__init__.py")):
        folder = init.parent
        name = ".".join(folder.relative_to(package.parent).parts)
        title = "rsibr (top)\n===========\n" if folder == package else _section(name, "=")
        modules = sorted(file.stem for file in folder.glob("*.py") if file.stem != "__init__")
        yield name, "\n".join([title, *(_section(f"{name}.{module}", "-") for module in modules)])


def _section(name: str, underline: str) -> str:
    """A module under its name, for its members to be linked to; what it hands on of others is documented there."""
    return f"{name}\n{underline * len(name)}\n\n.. automodule:: {name}\n   :ignore-module-all:\n"


def mark_long_code(_app: Sphinx, doctree: nodes.document) -> None:
    """Let `site.css` break long code in tables: the name of a test would take the width of the others' columns."""
    for literal in doctree.findall(nodes.literal):
        if len(literal.astext()) > LONG:
            literal["classes"].append("long")


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before any is read, and mark what is long in those that were."""
    app.connect("builder-inited", write_pages)
    app.connect("doctree-read", mark_long_code)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
