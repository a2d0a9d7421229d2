"""Images of reports: tone-mapped radiance, errors in false colour on a fixed scale, PNG encoding."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import binary_dilation

from rsibr.store.png_file import Rgba, exposure_of, to_bytes, tone_mapped
from rsibr.store.png_file import encode_png as png
from rsibr.validation.reference import Reference

__all__ = [
    "COLOUR_MAP",
    "FLIP",
    "RELATIVE_ERROR",
    "Rgba",
    "Scale",
    "bar_colours",
    "data_uri",
    "display_exposure",
    "false_colour",
    "outlined",
    "png",
    "shrunk",
    "tone_mapped",
]


@dataclass(frozen=True)
class Scale:
    """Scale of a false-colour image.

    Attributes
    ----------
    label : str
        Name of the quantity.
    low, high : float
        Ends of the colour bar; values beyond are clamped.
    logarithmic : bool
        Whether the scale is logarithmic.
    ticks : tuple of (float, str)
        Values to mark, and their labels.
    """

    label: str
    low: float
    high: float
    logarithmic: bool
    ticks: tuple[tuple[float, str], ...]

    def position(self, value: NDArray[np.floating] | float) -> NDArray[np.float64]:
        """Position of a value on the bar: 0 at its low end, 1 at its high end; NaN remains NaN."""
        low, high, x = self.low, self.high, np.asarray(value, dtype=np.float64)
        if self.logarithmic:
            low, high, x = np.log(low), np.log(high), np.log(np.maximum(x, low))
        return np.clip((x - low) / (high - low), 0.0, 1.0)


RELATIVE_ERROR = Scale(
    "relative error of a texel", 1e-3, 1.0, True, ((1e-3, "0.1 %"), (1e-2, "1 %"), (1e-1, "10 %"), (1.0, "100 %"))
)
FLIP = Scale("HDR-FLIP", 0.0, 1.0, False, ((0.0, "0"), (0.25, "0.25"), (0.5, "0.5"), (0.75, "0.75"), (1.0, "1")))

COLOUR_MAP = "magma"
"""Perceptually uniform, readable without colour vision; the default of FLIP."""

_COLOURS = 64
_QUALITY = 90
_EFFORT = 4
"""Of WebP, from 0 to 6."""


def display_exposure(references: Sequence[Reference]) -> float:
    """Exposure, a factor on radiance, for all images of a report.

    Parameters
    ----------
    references : sequence of Reference
        References of all views.

    Returns
    -------
    float
        Maps the 95th percentile of the maximum channel of texels with coverage ≥ ½ to 0.8; 1 if that is black.
    """
    return exposure_of(np.concatenate([r.mean[r.coverage >= 0.5].max(axis=-1) for r in references]))


def false_colour(values: NDArray[np.floating], scale: Scale) -> Rgba:
    """Convert numbers to colours; transparent where NaN.

    Parameters
    ----------
    values : ndarray, shape (H, W)
    scale : Scale

    Returns
    -------
    ndarray, shape (H, W, 4), uint8
    """
    position = scale.position(values)
    rgba = colormaps[COLOUR_MAP](np.nan_to_num(position))
    rgba[..., 3] = np.isfinite(position)
    return to_bytes(rgba)


def outlined(picture: Rgba, found: NDArray[np.bool_], colour: tuple[int, int, int]) -> Rgba:
    """Draw a visible square around each texel of `found`, without changing the texel itself.

    Parameters
    ----------
    picture : ndarray, shape (H, W, 4), uint8
    found : ndarray of bool, shape (H, W)
    colour : tuple of int
        Red, green, blue, 0 to 255.

    Returns
    -------
    ndarray, shape (H, W, 4), uint8
        New image; squares of neighbouring texels merge into one outline.
    """
    reach = max(2, len(found) // 40)
    inner, outer = (binary_dilation(found, np.ones((2 * r + 1, 2 * r + 1), np.bool_)) for r in (reach - 1, reach))
    return np.where((outer & ~inner)[..., None], np.array([*colour, 255], np.uint8), picture)


def bar_colours(count: int = 17) -> list[str]:
    """Colours along the bar of every scale, as CSS hex codes."""
    steps = to_bytes(colormaps[COLOUR_MAP](np.linspace(0.0, 1.0, count)))
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b, _ in steps.tolist()]


def shrunk(picture: Rgba, longest: int) -> Rgba:
    """Downsample an image by averaging blocks so that no side exceeds `longest`; smaller images are unchanged."""
    block = -(-max(picture.shape[:2]) // longest)
    if block == 1:
        return picture
    height, width = (-(-side // block) * block for side in picture.shape[:2])
    padding = ((0, height - picture.shape[0]), (0, width - picture.shape[1]), (0, 0))
    padded = np.pad(picture, padding, mode="edge").astype(np.float64) / 255
    premultiplied = np.concatenate([padded[..., :3] * padded[..., 3:], padded[..., 3:]], axis=-1)
    mean = premultiplied.reshape(height // block, block, width // block, block, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
    return to_bytes(mean)


def data_uri(picture: Rgba, *, exact: bool = False) -> str:
    """Encode an image as a data URI, to embed it in HTML.

    Parameters
    ----------
    picture : ndarray, shape (H, W, 4), uint8
    exact : bool
        Lossless in 64 colours, for false colour; otherwise WebP of high quality, an eighth of the size of a PNG.

    Returns
    -------
    str
        `data:image/webp;base64,…`
    """
    stream = io.BytesIO()
    image = Image.fromarray(picture)
    if exact:
        image.quantize(_COLOURS).save(stream, "WEBP", lossless=True, method=_EFFORT)
    else:
        image.save(stream, "WEBP", quality=_QUALITY, method=_EFFORT)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode("ascii")
