"""Alignment of photographs that were taken by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.brackets.one_size import check_one_size
from rsibr.capture.curves.srgb import SRGB
from rsibr.capture.photographs.photograph import Photograph, opencv
from rsibr.errors import InputError

Grey = NDArray[np.uint8]

_MIDDLE = (8, 247)
"""Values [of 255] that show something: neither black nor saturated."""

_LEAST_SEEN = 0.01
"""Share of the pixels that must show something in both photographs."""

_LEAST_SIDE = 8  # pixels; a smaller picture shows too little to be aligned

_LEAST_RESPONSE = 0.05  # of a phase correlation; 1 for equal pictures, about 0.01 for unrelated ones


@dataclass(frozen=True, eq=False)
class Alignment:
    """Photographs of one view, pixel on pixel.

    Attributes
    ----------
    photographs : tuple of Photograph
        Shifted, and cut to what they share; in the order given.
    shifts : dict of str to (int, int)
        Columns and rows by which each was moved, by its name.
    left_out : tuple of str
        Names of those that show too little to be aligned.
    """

    photographs: tuple[Photograph, ...]
    shifts: dict[str, tuple[int, int]]
    left_out: tuple[str, ...]


def aligned(photographs: Sequence[Photograph]) -> Alignment:
    """Shift photographs to the best exposed one, and cut all to what they share.

    Parameters
    ----------
    photographs : sequence of Photograph
        Of one view, each with its exposure.

    Raises
    ------
    InputError
        If they differ in size, or share nothing.

    Notes
    -----
    By OpenCV's phase correlation with the best exposed one, brought to the same exposure; only where the two show too
    little in common with a nearer one, since from neighbour to neighbour errors add up. (Median threshold bitmaps,
    OpenCV's `AlignMTB`, need a picture with a dark and a bright half: of eight brackets they missed those that are
    nearly black or white, by up to 63 pixels.) A photograph in which next to nothing is seen, such as the sun alone, is
    left out, unless none of the others has moved: a sun in the wrong place would leave a black one in its own.
    """
    check_one_size(photographs)
    greys = [_grey(one.values) for one in photographs]
    anchor = int(np.argmin([abs(float(np.median(grey)) - 127.5) for grey in greys]))
    shifts = _shifts(photographs, anchor)
    if set(shifts.values()) == {(0, 0)}:  # a tripod: what shows too little to tell did not move either
        shifts = dict.fromkeys(range(len(photographs)), (0, 0))
    kept = sorted(shifts)
    return Alignment(
        _cut([photographs[index] for index in kept], [shifts[index] for index in kept]),
        {photographs[index].name: shifts[index] for index in kept},
        tuple(one.name for index, one in enumerate(photographs) if index not in shifts),
    )


def _shifts(photographs: Sequence[Photograph], anchor: int) -> dict[int, tuple[int, int]]:
    """Columns and rows by which each is to be moved, by its index, as far as it can be told.

    Compared with the best exposed one; where the two show too little in common, with the nearest exposure that has been
    placed.
    """
    stops = [math.log2(one.exposure.amount) if one.exposure else 0.0 for one in photographs]
    found = {anchor: (0, 0)}
    for index in sorted(range(len(photographs)), key=lambda one: abs(stops[one] - stops[anchor])):
        others = sorted(found, key=lambda one: (one != anchor, abs(stops[one] - stops[index])))
        for other in others if index not in found else ():
            shift = _shift(photographs[other], photographs[index])
            if shift is not None:
                found[index] = (shift[0] + found[other][0], shift[1] + found[other][1])
                break
    return found


def _shift(anchor: Photograph, one: Photograph) -> tuple[int, int] | None:
    """Columns and rows by which one is to be moved; None if it cannot be told."""
    expected = _at_exposure_of(anchor, one)
    told = (expected >= _MIDDLE[0]) & (expected <= _MIDDLE[1])
    if min(one.size) < _LEAST_SIDE or told.mean() < _LEAST_SEEN:
        return None
    (columns, rows), response = _phase(expected, _grey(one.values))
    return (-round(columns), -round(rows)) if response > _LEAST_RESPONSE else None


def _phase(anchor: Grey, grey: Grey) -> tuple[tuple[float, float], float]:
    cv2: Any = opencv()
    window = cv2.createHanningWindow((grey.shape[1], grey.shape[0]), cv2.CV_32F)
    moved, response = cv2.phaseCorrelate(anchor.astype(np.float32), grey.astype(np.float32), window)
    return moved, float(response)


def _at_exposure_of(anchor: Photograph, one: Photograph) -> Grey:
    """The best exposed photograph as it would look at the exposure of another, saturation included."""
    if anchor.exposure is None or one.exposure is None:
        return _grey(anchor.values)
    ratio = one.exposure.amount / anchor.exposure.amount
    if anchor.is_linear:
        return _grey(np.minimum(anchor.values * ratio, 1.0))
    return _grey(SRGB.encoded(np.minimum(SRGB.linear(anchor.values) * ratio, 1.0)))


def _grey(values: NDArray[np.floating]) -> Grey:
    return np.asarray(np.rint(np.clip(values.mean(axis=2), 0.0, 1.0) * 255), dtype=np.uint8)


def _cut(photographs: Sequence[Photograph], shifts: Sequence[tuple[int, int]]) -> tuple[Photograph, ...]:
    width, height = photographs[0].size
    columns, rows = np.array(shifts).T
    left, right = max(columns.max(), 0), width + min(columns.min(), 0)
    top, bottom = max(rows.max(), 0), height + min(rows.min(), 0)
    if left >= right or top >= bottom:
        what = f"the photographs are shifted by up to {max(np.ptp(columns), np.ptp(rows))} pixels and share nothing"
        raise InputError(what, where="shots", fix="leave out those of another view, or use --no-align")
    return tuple(
        replace(one, values=np.ascontiguousarray(one.values[top - dy : bottom - dy, left - dx : right - dx]))
        for one, (dx, dy) in zip(photographs, shifts, strict=True)
    )
