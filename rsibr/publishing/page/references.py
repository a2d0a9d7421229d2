"""References of a validation in a page: radiance in half precision, and the numbers that its error map takes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rsibr.errors import InputError
from rsibr.publishing.bundle.encoding import Encoded, encoded_images
from rsibr.store.bake import Bake
from rsibr.store.noise import COVERED, denominator
from rsibr.validation.report.pictures import RELATIVE_ERROR
from rsibr.validation.report.references import read_references

MANTISSA = 8
"""Bits of mantissa that references keep: a rounding of 0.1 %, the low end of the scale of errors."""


@dataclass(frozen=True, eq=False)
class PageReferences:
    """References of a page.

    Attributes
    ----------
    meta : list of dict
        Of each view as the page's JSON holds it: `frame` (columns x, y, v), `label`, `size` in texels, `floors` (what
        is added to the squared radiance of each channel), `noise` (relMSE of a perfect map).
    arrays : dict of str to Encoded
        Radiance of each, `reference0` ….
    """

    meta: list[dict[str, Any]] = field(default_factory=list)
    arrays: dict[str, Encoded] = field(default_factory=dict)


def page_references(bake: Bake, directory: Path | None) -> PageReferences:
    """References that a validation of a bake has stored; none without a directory.

    Raises
    ------
    InputError
        If the directory holds no validation, or that of another bake.
    BakeError
        If a file is damaged.
    """
    if directory is None:
        return PageReferences()
    found = read_references(directory)
    if found.config_hash != bake.manifest.config_hash:
        fix = f"run `rsibr validate {bake.path}`"
        raise InputError(f"is a validation of another bake than {bake.path}", where=str(directory), fix=fix)
    meta, arrays = [], {}
    for number, (one, label) in enumerate(zip(found.maps, found.labels, strict=True)):
        judged = one.coverage >= COVERED
        truth = one.radiance[judged].astype(np.float64)
        squared = denominator(truth)
        noise = 0.0 if one.variance is None else float((one.variance[judged] / squared).mean())
        meta.append(
            {
                "frame": one.frame.T.astype(np.float32).ravel().tolist(),
                "label": label,
                "size": one.resolution,
                "floors": np.take_along_axis(squared - truth**2, truth.argmin(axis=0)[None], 0)[0].tolist(),
                "noise": noise,
            }
        )
        arrays[f"reference{number}"] = encoded_images(one.radiance, "half", MANTISSA)
    return PageReferences(meta, arrays)


def error_scale() -> dict[str, Any]:
    """Scale of the map of errors, that of the report: ends, and ticks as [place from 0 to 1, label]."""
    ticks = [[float(RELATIVE_ERROR.position(value)), text] for value, text in RELATIVE_ERROR.ticks]
    return {"range": [RELATIVE_ERROR.low, RELATIVE_ERROR.high], "ticks": ticks}
