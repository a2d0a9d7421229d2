"""Alignment of photographs that were taken by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.brackets.one_size import check_one_size
from rsibr.capture.curves.curve import Curve
from rsibr.capture.curves.srgb import SRGB
from rsibr.capture.photographs.photograph import Photograph, opencv

Grey = NDArray[np.uint8]

_MIDDLE = (8, 247)
"""Values [of 255] that show something: neither black nor saturated."""

_LEAST_SEEN = 0.01
"""Share of the pixels that must show something in both photographs."""

_CLEARLY_LESS = 0.8
"""Share of the difference of two pictures as they lie that may be left once one is shifted."""

_LEAST_SIDE = 8  # pixels; a smaller picture shows too little to be aligned

_LEAST_RESPONSE = 0.05  # of a phase correlation; 1 for equal pictures, about 0.01 for unrelated ones


@dataclass(frozen=True, eq=False)
class Alignment:
    """Photographs of one view, pixel on pixel.

    Attributes
    ----------
    photographs : tuple of Photograph
        In the frame of the best exposed one, which is not moved; NaN where a shifted one shows nothing. In the order
        given.
    shifts : dict of str to (int, int)
        Columns and rows by which each was moved, by its name.
    left_out : tuple of str
        Names of those that show too little to be aligned.
    """

    photographs: tuple[Photograph, ...]
    shifts: dict[str, tuple[int, int]]
    left_out: tuple[str, ...]


def aligned(photographs: Sequence[Photograph], curve: Curve = SRGB) -> Alignment:
    """Shift photographs to the best exposed one.

    Parameters
    ----------
    photographs : sequence of Photograph
        Of one view, each with its exposure.
    curve : Curve
        Of the camera, by which one is brought to the exposure of another; an approximate one will do.

    Raises
    ------
    InputError
        If they differ in size.

    Notes
    -----
    The size stays, and with it the middle of the picture and the field of view, by which cameras are placed. By
    OpenCV's phase correlation with the best exposed one, brought to the same exposure; only where the two show too
    little in common with a nearer one, since from neighbour to neighbour errors add up. (Median threshold bitmaps,
    OpenCV's `AlignMTB`, need a picture with a dark and a bright half: they miss shots that are nearly black or white.)
    A photograph in which next to nothing is seen, such as the sun alone, is left out, unless none of the others has
    moved: a sun in the wrong place would leave a black one in its own. A shift counts only where the two then differ
    clearly less: smooth pictures, such as a ball under an even sky, correlate nearly as well
    elsewhere.
    """
    check_one_size(photographs)
    greys = [_grey(one.values) for one in photographs]
    anchor = int(np.argmin([abs(float(np.median(grey)) - 127.5) for grey in greys]))
    shifts = _shifts(photographs, anchor, curve)
    if set(shifts.values()) == {(0, 0)}:  # a tripod: what shows too little to tell did not move either
        shifts = dict.fromkeys(range(len(photographs)), (0, 0))
    kept = sorted(shifts)
    return Alignment(
        _moved([photographs[index] for index in kept], [shifts[index] for index in kept]),
        {photographs[index].name: shifts[index] for index in kept},
        tuple(one.name for index, one in enumerate(photographs) if index not in shifts),
    )


def _shifts(photographs: Sequence[Photograph], anchor: int, curve: Curve) -> dict[int, tuple[int, int]]:
    """Columns and rows by which each is to be moved, by its index, as far as it can be told.

    Compared with the best exposed one; where the two show too little in common, with the nearest exposure that has been
    placed.
    """
    stops = [math.log2(one.exposure.amount) if one.exposure else 0.0 for one in photographs]
    found = {anchor: (0, 0)}
    for index in sorted(range(len(photographs)), key=lambda one: abs(stops[one] - stops[anchor])):
        others = sorted(found, key=lambda one: (one != anchor, abs(stops[one] - stops[index])))
        for other in others if index not in found else ():
            shift = _shift(photographs[other], photographs[index], curve)
            if shift is not None:
                found[index] = (shift[0] + found[other][0], shift[1] + found[other][1])
                break
    return found


def _shift(anchor: Photograph, one: Photograph, curve: Curve) -> tuple[int, int] | None:
    """Columns and rows by which one is to be moved; None if it cannot be told."""
    expected, grey = _at_exposure_of(anchor, one, curve), _grey(one.values)
    told = _is_middle(anchor.values) & _is_middle(expected / np.float32(255))
    if min(one.size) < _LEAST_SIDE or told.mean() < _LEAST_SEEN:
        return None
    (columns, rows), response = _phase(expected, grey)
    if response <= _LEAST_RESPONSE:
        return None
    shift = -round(columns), -round(rows)
    is_better = _difference(expected, grey, told, shift) < _CLEARLY_LESS * _difference(expected, grey, told, (0, 0))
    return shift if is_better else (0, 0)


def _is_middle(values: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Pixels whose encoded values, in each channel if there are several, are neither black nor saturated."""
    low, high = (values, values) if values.ndim == 2 else (values.min(axis=2), values.max(axis=2))
    return np.asarray((low >= _MIDDLE[0] / 255) & (high <= _MIDDLE[1] / 255))


def _difference(expected: Grey, grey: Grey, told: NDArray[np.bool_], shift: tuple[int, int]) -> float:
    """Mean absolute difference of what is expected and a shifted picture, where the first is told."""
    columns, rows = shift
    (height, width), ahead = expected.shape, (max(columns, 0), max(rows, 0))
    if abs(columns) >= width or abs(rows) >= height:
        return math.inf
    there = slice(ahead[1], height + min(rows, 0)), slice(ahead[0], width + min(columns, 0))
    here = slice(there[0].start - rows, there[0].stop - rows), slice(there[1].start - columns, there[1].stop - columns)
    off = np.abs(expected[there].astype(np.float64) - grey[here])[told[there]]
    return float(off.mean()) if off.size else math.inf


def _phase(anchor: Grey, grey: Grey) -> tuple[tuple[float, float], float]:
    cv2: Any = opencv()
    window = cv2.createHanningWindow((grey.shape[1], grey.shape[0]), cv2.CV_32F)
    moved, response = cv2.phaseCorrelate(anchor.astype(np.float32), grey.astype(np.float32), window)
    return moved, float(response)


def _at_exposure_of(anchor: Photograph, one: Photograph, curve: Curve) -> Grey:
    """The best exposed photograph as it would look at the exposure of another, saturation included."""
    if anchor.exposure is None or one.exposure is None:
        return _grey(anchor.values)
    ratio = one.exposure.amount / anchor.exposure.amount
    if anchor.is_linear:
        return _grey(np.minimum(anchor.values * ratio, 1.0))
    return _grey(curve.encoded(np.minimum(curve.linear(anchor.values) * ratio, 1.0)))


def _grey(values: NDArray[np.floating]) -> Grey:
    return np.asarray(np.rint(np.clip(values.mean(axis=2), 0.0, 1.0) * 255), dtype=np.uint8)


def _moved(photographs: Sequence[Photograph], shifts: Sequence[tuple[int, int]]) -> tuple[Photograph, ...]:
    return tuple(
        one if shift == (0, 0) else replace(one, values=_shifted(one.values, *shift))
        for one, shift in zip(photographs, shifts, strict=True)
    )


def _shifted(values: NDArray[np.float32], columns: int, rows: int) -> NDArray[np.float32]:
    """Picture moved to the right and down, NaN where nothing came."""
    height, width = values.shape[:2]
    moved = np.full_like(values, np.nan)
    there = slice(max(rows, 0), height + min(rows, 0)), slice(max(columns, 0), width + min(columns, 0))
    moved[there] = values[max(-rows, 0) : height - max(rows, 0), max(-columns, 0) : width - max(columns, 0)]
    return moved
