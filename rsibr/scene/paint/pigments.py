"""Named pigments: measured spectral reflectances of chart patches from colour-science, and their linear Rec.709."""

from __future__ import annotations

import difflib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError

CHART = "ColorChecker N Ohta"
"""Spectral reflectances of the 24 patches of a colour chart, 380 to 780 nm (Ohta 1997), from colour-science."""


def pigment_reflectance(name: str) -> NDArray[np.float64]:
    """Reflectance of a patch under daylight.

    Parameters
    ----------
    name : str
        A patch of `CHART`, for example ``"moderate red"``.

    Returns
    -------
    ndarray, shape (3,)
        Linear Rec.709 in [0, 1] of the spectrum under D65 for the CIE 1931 2° observer; a perfect white is 1. Colours
        outside Rec.709 are clipped.

    Raises
    ------
    InputError
        If there is no such patch.

    Examples
    --------
    >>> pigment_reflectance("neutral 5 (.70 D)").round(1).tolist()
    [0.2, 0.2, 0.2]
    """
    import colour  # noqa: PLC0415  # takes a second, and most paints are given as RGB

    patch = _patch(name)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(observer.shape)
    xyz = colour.sd_to_XYZ(patch, observer, daylight) / 100
    return np.clip(colour.XYZ_to_RGB(xyz, "ITU-R BT.709", apply_cctf_encoding=False), 0.0, 1.0)


def pigment_spectrum(name: str, wavelengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reflectance of a patch at wavelengths [nm], in [0, 1]; constant beyond the measured range.

    Raises
    ------
    InputError
        If there is no such patch.
    """
    patch = _patch(name)
    return np.asarray(np.clip(np.interp(wavelengths, patch.wavelengths, patch.values), 0.0, 1.0))


def _patch(name: str) -> Any:
    import colour  # noqa: PLC0415  # takes a second, and most paints are given as RGB

    patches = colour.SDS_COLOURCHECKERS[CHART]
    if name not in patches:
        near = difflib.get_close_matches(name, patches, n=1)
        raise InputError(
            f"there is no pigment '{name}'{f' (did you mean {near[0]!r}?)' if near else ''}, only colours and: "
            f"{', '.join(patches)}"
        )
    return patches[name]
