"""Calibration of a response curve from exposure brackets (Debevec and Malik 1997)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsibr.capture.curves.curve import KNOTS, Curve
from rsibr.capture.photographs.photograph import Photograph, opencv
from rsibr.errors import InputError

NAME = "debevec"

_SAMPLES = 300
_SMOOTHNESS = 10.0
_LEAST_RISE = 1e-7


def calibrated(photographs: Sequence[Photograph]) -> Curve:
    """Response curve that explains how the values of brackets change with their exposure.

    Parameters
    ----------
    photographs : sequence of Photograph
        Aligned, of 8 bits, with at least two different exposures.

    Returns
    -------
    Curve
        Made monotone; 1 is saturation.

    Raises
    ------
    InputError
        If the photographs have other bits, exposures are unknown, or all are the same.

    Notes
    -----
    Equation 3 of the paper, by OpenCV's `CalibrateDebevec`.
    """
    cv2 = opencv()
    if any(one.levels != 255 for one in photographs):
        fix = "use --curve linear, srgb or a file"
        raise InputError("a curve is calibrated from photographs of 8 bits", where="curve", fix=fix)
    amounts = [one.exposure.amount for one in photographs if one.exposure is not None]
    if len(amounts) < len(photographs) or len(set(amounts)) < 2:
        what = "a curve cannot be calibrated without different, known exposures"
        raise InputError(what, where="curve", fix="give brackets with EXIF data, or --exposures")
    images = [np.rint(one.values[..., ::-1] * 255).astype(np.uint8) for one in photographs]
    solver = cv2.createCalibrateDebevec(samples=_SAMPLES, lambda_=_SMOOTHNESS, random=False)
    try:
        response = solver.process(images, np.array(amounts, dtype=np.float32)).reshape(256, 3)[:, ::-1].T
    except cv2.error as error:  # fewer pixels than samples
        raise _not_found() from error
    return _curve(np.asarray(response, dtype=np.float64))


def _not_found() -> InputError:
    fix = "photograph something with more contrast, or use --curve srgb"
    return InputError("the curve cannot be found in these photographs", where="curve", fix=fix)


def _curve(response: np.ndarray) -> Curve:
    """Monotone curve from exposures at the 256 values; the ends, which no sample supports, are extended."""
    if not np.isfinite(response).all():
        raise _not_found()
    rising = np.maximum.accumulate(response, axis=1)
    scaled = rising / rising[:, -1:]
    scaled -= scaled[:, :1] * np.linspace(1.0, 0.0, 256)  # value 0 is no exposure
    at = np.linspace(0.0, 1.0, KNOTS)
    knots = np.stack([np.interp(at, np.linspace(0.0, 1.0, 256), one) for one in scaled])
    knots = np.maximum.accumulate(knots, axis=1) + _LEAST_RISE * at
    return Curve(NAME, knots / knots[:, -1:])
