"""The pages of the documentation as text: code blocks, inline code, links, entries of toctrees."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
GENERATED = ("notebooks", "reference/public", "reference/rooms")
"""Folders that a build fills."""

_FENCE = re.compile(r"^(```+|:::+)(.*?)\n(.*?)^\1\s*$", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


@dataclass(frozen=True)
class Page:
    """A page in Markdown.

    Attributes
    ----------
    path : Path
        Its file.
    """

    path: Path

    @property
    def name(self) -> str:
        """Path from the folder of the repository."""
        return str(self.path.relative_to(ROOT))

    @cached_property
    def text(self) -> str:
        """Whole content."""
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def prose(self) -> str:
        """Content without blocks and comments."""
        return _FENCE.sub("", _COMMENT.sub("", self.text))

    def blocks(self, language: str) -> list[str]:
        """Content of the code blocks in a language, or of the directives of a name."""
        return [body for _, info, body in _FENCE.findall(self.text) if info.strip() == language]

    def inline_code(self) -> list[str]:
        """Content of inline code."""
        return re.findall(r"`([^`\n]+)`", self.prose)

    def links(self) -> list[str]:
        """Targets of the links within the repository."""
        targets = re.findall(r"\]\(([^)\s]+)\)", self.prose) + re.findall(r"\{download\}`.*?<(.+?)>`", self.prose)
        return [target for target in targets if not re.match(r"\w+:", target)]

    def entries(self) -> Iterator[str]:
        """Pages that its toctrees name, as paths from `docs` without an ending; globs as they stand."""
        for body in self.blocks("{toctree}"):
            for line in body.splitlines():
                if line.strip() and not line.startswith(":"):
                    yield str((self.path.parent / line.strip()).resolve().relative_to(DOCS)).removesuffix(".md")


def pages() -> list[Page]:
    """Pages below `docs` that are written by hand."""
    written = [path for path in sorted(DOCS.rglob("*.md")) if not _is_generated(path)]
    return [Page(path) for path in written]


def front_pages() -> list[Page]:
    """Pages beside the code."""
    return [Page(ROOT / name) for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]


def _is_generated(path: Path) -> bool:
    return any(path.is_relative_to(DOCS / folder) for folder in GENERATED)
