"""Names of the methods for help texts and shell completion, read from their source without running it.

The registry imports every method, and with them Mitsuba: more than a help text may take.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

ENTRY_POINTS = "rsibr.methods"
_DECLARES = ("register", "register_alias")
_LAST = 100  # rank of a method that states none, as in the registry


@cache
def listed_methods() -> tuple[str, ...]:
    """Names of the listed methods, as `rsibr.method_names()` returns them; of other packages, names of entry points.

    Examples
    --------
    >>> listed_methods()[:3]
    ('nearest', 'blend', 'cabral1999')
    """
    folder = Path(__file__).resolve().parents[1] / "methods"
    found = [one for path in sorted(folder.rglob("*.py")) for one in _declared(path.read_text(encoding="utf-8"))]
    ours = [name for _rank, name in sorted(found, key=lambda one: one[0])]
    return tuple(dict.fromkeys([*ours, *(entry.name for entry in entry_points(group=ENTRY_POINTS))]))


def _declared(source: str) -> Iterator[tuple[int, str]]:
    """Rank and name of each listed method that a module registers, by a decorator or a call."""
    if not any(f"{name}(\n" in source or f'{name}("' in source for name in _DECLARES):
        return  # parsing takes a millisecond a file
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _DECLARES:
            given = {keyword.arg: keyword.value for keyword in node.keywords}
            name, rank, listed = node.args[0], given.get("rank"), given.get("listed")
            if isinstance(name, ast.Constant) and not (isinstance(listed, ast.Constant) and listed.value is False):
                yield rank.value if isinstance(rank, ast.Constant) else _LAST, str(name.value)  # type: ignore[misc]
