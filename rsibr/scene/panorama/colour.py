"""Conversion of stated colours to Rec.709 primaries with white D65, the colours of all radiance in rsibr."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.panorama.picture import Chromaticities, Picture, Point

REC709: Chromaticities = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""CIE x, y of red, green, blue and white: ITU-R BT.709-6, table 1."""

XYZ: Chromaticities = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0)
"""Primaries whose RGB values are CIE XYZ."""

ADAPTATION = "Bradford"
"""Chromatic adaptation transform: that of ICC profiles (ICC.1:2022, annex E) and of the ACES output transforms."""

SAME = 1e-3
"""Difference of x or y up to which two colours count as equal: headers round to three or four digits."""

_LEAST_AREA = 1e-3
"""Twice the least area of a triangle of primaries in the plane of x and y; that of Rec.709 is 0.22."""

_LARGEST = 1e3
"""Largest coefficient of a conversion; the widest usual primaries, ACES 2065-1, have 2.6."""

Matrix = NDArray[np.float64]


def to_rec709(picture: Picture, where: str) -> tuple[NDArray[np.float32], tuple[str, ...]]:
    """Convert a picture to Rec.709.

    Parameters
    ----------
    picture : Picture
        Picture with the colours that its header states. Its white, or the neutral colour that the header states in its
        place, becomes white by chromatic adaptation. XYZ has no white, and is converted as it is without a neutral.
    where : str
        File that an error names.

    Returns
    -------
    image : ndarray (H, W, 3), float32
        The same array if there is nothing to convert. Colours outside Rec.709 have negative channels.
    notes : tuple of str
        What was converted.

    Raises
    ------
    InputError
        If the primaries or the white define no colour space.
    """
    stated = XYZ if picture.xyz else picture.chromaticities or REC709
    if _same(stated, REC709) and (picture.neutral is None or _same(picture.neutral, REC709[6:])):
        return picture.image, ()
    if _same(stated, XYZ) and (picture.neutral is None or _same(picture.neutral, REC709[6:])):
        matrix: Matrix = np.linalg.inv(_to_xyz(REC709, where)).astype(np.float64)
        return _times(matrix, picture.image), ("its CIE XYZ values were converted to Rec.709",)
    white = picture.neutral or stated[6:]
    matrix = rec709_matrix(stated, picture.neutral, where)
    adapted = "" if _same(white, REC709[6:]) else f", its white {_xy(white)} adapted to D65 ({ADAPTATION})"
    return _times(matrix, picture.image), (f"its colours were converted to Rec.709 from the stated ones{adapted}",)


def rec709_matrix(stated: Chromaticities, neutral: Point | None = None, where: str = "") -> Matrix:
    """Matrix (3, 3) from linear RGB of given primaries and white to linear Rec.709.

    Parameters
    ----------
    stated : tuple of 8 floats
        CIE x, y of red, green, blue and white.
    neutral : tuple of 2 floats, optional
        Colour that becomes white; by default the white.
    where : str
        File that an error names.

    Returns
    -------
    ndarray (3, 3), float64

    Raises
    ------
    InputError
        If they define no colour space.

    Examples
    --------
    The white of ACEScg becomes that of Rec.709:

    >>> acescg = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    >>> (rec709_matrix(acescg) @ [0.5, 0.5, 0.5]).round(6).tolist()
    [0.5, 0.5, 0.5]
    """
    import colour  # noqa: PLC0415  # takes a second, and most files are Rec.709

    _require_colours(stated, where)
    white = np.array(neutral or stated[6:], dtype=np.float64)
    _require_white(white, where)
    to_xyz = _to_xyz(stated, where)
    adaptation: Matrix = np.eye(3)
    if not _same(tuple(white), REC709[6:]):
        source, target = colour.xy_to_XYZ(white), colour.xy_to_XYZ(np.array(REC709[6:]))
        found = colour.adaptation.matrix_chromatic_adaptation_VonKries(source, target, transform=ADAPTATION)
        adaptation = np.asarray(found, dtype=np.float64)
    matrix: Matrix = np.linalg.inv(_to_xyz(REC709, where)).astype(np.float64) @ adaptation @ to_xyz
    if not (np.isfinite(matrix).all() and np.abs(matrix).max() < _LARGEST):
        raise _no_space(stated, where)
    return matrix


def _to_xyz(stated: Chromaticities, where: str) -> Matrix:
    """Matrix from RGB to XYZ whose white has Y = 1: SMPTE RP 177-1993, written without a division by y."""
    if _same(stated, XYZ):
        return np.eye(3)
    x, y = np.array(stated[0:6:2]), np.array(stated[1:6:2])
    primaries: Matrix = np.stack([x, y, 1.0 - x - y])
    white = np.array([stated[6], stated[7], 1.0 - stated[6] - stated[7]]) / stated[7]
    shares: Matrix = np.linalg.solve(primaries, white).astype(np.float64)
    if not (shares > 0.0).all():  # the white lies outside their triangle
        raise _no_space(stated, where)
    return primaries * shares


def _require_colours(stated: Chromaticities, where: str) -> None:
    x, y = np.array(stated[0:6:2], dtype=np.float64), np.array(stated[1:6:2], dtype=np.float64)
    if not (np.isfinite(stated).all() and np.abs(stated).max() < 2.0):
        raise _no_space(stated, where)
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    if abs(area) < _LEAST_AREA:
        raise _no_space(stated, where)
    _require_white(np.array(stated[6:]), where)


def _require_white(white: NDArray[np.float64], where: str) -> None:
    if not (np.isfinite(white).all() and (white > 0.01).all() and white.sum() < 0.99):
        raise InputError(f"states the white {_xy(tuple(white))}, which is none", where=where, fix="correct its header")


def _no_space(stated: Chromaticities, where: str) -> InputError:
    points = ", ".join(_xy(stated[i : i + 2]) for i in range(0, 8, 2))
    return InputError(
        f"states primaries and a white that define no colours: {points}", where=where, fix="correct its header"
    )


def _times(matrix: Matrix, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Multiply each colour; values beyond float32 become infinite, which the caller refuses.

    Written out: a product of BLAS rounds differently from one processor to another, and a digest depends on the bits.
    """
    rows, (red, green, blue) = matrix.astype(np.float32), np.moveaxis(image, -1, 0)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([row[0] * red + row[1] * green + row[2] * blue for row in rows], axis=-1)


def _same(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return bool((np.abs(np.subtract(a, b)) <= SAME).all())


def _xy(point: tuple[float, ...]) -> str:
    return f"({point[0]:.4g}, {point[1]:.4g})"
