"""Bundle: all that the page needs of one bake, as JSON in a script tag."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rsibr import backend
from rsibr.errors import InputError, did_you_mean
from rsibr.methods.method_set import MethodSet
from rsibr.methods.registry import available, default_method
from rsibr.publishing.bundle.contents import SIZES, Request, drawn, parts_of
from rsibr.publishing.bundle.encoding import Encoded, Precision
from rsibr.store.stored_maps import StoredMaps

FORMAT = 1
"""Format of bundles; the page refuses another."""

LEAST_SIZE, MOST_SIZE = 16, 2048
"""Limits of the maps that a page makes [texels a side]."""

MAIN = ("nearest", "blend", "cabral1999", "rsibr")
"""Methods of a bundle by default: those that read one set of maps."""


@dataclass(frozen=True, eq=False, repr=False)
class Bundle:
    """Part of a bake that a page needs.

    Attributes
    ----------
    meta : dict
        Names, sizes and numbers, as JSON holds them.
    arrays : dict of str to Encoded
        Arrays by name.
    """

    meta: dict[str, Any]
    arrays: dict[str, Encoded]

    def __repr__(self) -> str:
        return f"Bundle({self.meta['name']!r}, {', '.join(self.meta['methods'])}, {self.size / 2**20:.2f} MiB)"

    @property
    def size(self) -> int:
        """Size of the script tag [bytes]."""
        return len(self.to_script())

    def to_script(self, identifier: str = "rsibr-bundle") -> str:
        """Return a script tag of the type application/json with this `id`."""
        arrays = {name: one.to_json() for name, one in self.arrays.items()}
        text = json.dumps({**self.meta, "arrays": arrays}, separators=(",", ":"), ensure_ascii=True)
        safe = text.replace("<", "\\u003c")  # nothing in a string ends the tag or opens a comment
        return f'<script type="application/json" id="{identifier}">{safe}</script>'


@backend.in_session
def bundle_of(
    bake: StoredMaps,
    *,
    precision: Precision = "half",
    methods: Sequence[str] | None = None,
    light_size: int | None = None,
    sizes: Sequence[int] = SIZES,
) -> Bundle:
    """Bundle a bake for the page.

    Parameters
    ----------
    bake : StoredMaps
        A finished bake.
    precision : {"half", "float"}
        Numbers of radiance maps: 16 bits, of which a map's relative error is some 1e-4, or 32.
    methods : sequence of str, optional
        Methods that the page offers, of `rsibr.publishing.bundle.contents.drawn`; by default those of `MAIN` that the
        bake serves.
    light_size : int, optional
        Texels a side of the octahedral image of the environment; by default as many as the lobes of the bake ask for.
    sizes : sequence of int
        Texels a side of the maps that the page makes, beside those of the bake.

    Returns
    -------
    Bundle

    Raises
    ------
    InputError
        If a method is unknown, cannot be drawn by a page, or is not served by the bake, or a size is out of range.

    Examples
    --------
    >>> bundle = bundle_of(rsibr.open_bake("paint.rsibr"))     # doctest: +SKIP
    >>> bundle.meta["methods"]                                  # doctest: +SKIP
    ['nearest', 'blend', 'cabral1999', 'rsibr']
    """
    chosen = _chosen(bake, methods)
    wanted = sorted({*sizes, bake.resolution})
    if not all(LEAST_SIZE <= size <= MOST_SIZE for size in wanted):
        raise InputError(f"maps of {wanted} texels", where="sizes", fix=f"give {LEAST_SIZE} to {MOST_SIZE}")
    request = Request(MethodSet(bake), precision, light_size, tuple(wanted))
    parts = {name: make(request) for name, make in parts_of(chosen).items()}
    default = default_method(bake)
    meta = {
        "format": FORMAT,
        "name": bake.path.stem,
        "precision": precision,
        "methods": list(chosen),
        "default": default if default in chosen else chosen[-1],
        "sizes": wanted,
        **{name: part.meta for name, part in parts.items() if part.arrays},
    }
    arrays = {f"{name}.{key}": array for name, part in parts.items() for key, array in part.arrays.items()}
    return Bundle(meta, arrays)


def _chosen(bake: StoredMaps, methods: Sequence[str] | None) -> tuple[str, ...]:
    """Methods to bundle, in the order of the registry."""
    served = [name for name in available(bake) if name in drawn()]
    if methods is None:
        return tuple(name for name in served if name in MAIN)
    for name in methods:
        if name not in drawn():
            fix = did_you_mean(name, drawn()) + f"there are: {', '.join(drawn())}"
            raise InputError(f"a page cannot draw '{name}'", where="methods", fix=fix)
        if name not in served:
            raise InputError(f"the bake does not serve '{name}'", where=str(bake.path), fix=f"give of: {served}")
    return tuple(name for name in served if name in methods)
