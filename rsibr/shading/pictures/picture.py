"""Picture of an object: radiance, coverage, depth and normals of each pixel."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class NormalCounts:
    """How many of the rays that met a surface had a shading normal that was made safe, and how many saw its back.

    Attributes
    ----------
    hits : int
        Rays that met a surface.
    replaced : int
        Shading normals without direction (zero or NaN), replaced by the geometric normal.
    flipped : int
        Shading normals against the geometric normal of the file.
    bent : int
        Shading normals that faced away from the viewer, bent to the horizon.
    back : int
        Hits on the inner side of a surface.
    """

    hits: int
    replaced: int
    flipped: int
    bent: int
    back: int


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """Rendered picture of an object, row 0 at the top.

    Attributes
    ----------
    radiance : ndarray, shape (H, W, 3), float32
        Mean over the pixel's square [W sr⁻¹ m⁻²], black where rays miss: premultiplied by `alpha`.
    alpha : ndarray, shape (H, W), float32
        Share of the pixel's rays that meet a surface.
    depth : ndarray, shape (H, W), float32
        Mean distance from the camera over the rays that meet a surface; infinite if none does.
    normal : ndarray, shape (H, W, 3), float32
        Unit mean of the safe shading normals in world coordinates; zero if no ray meets a surface.
    counts : NormalCounts
        Shading normals that were made safe.
    seconds : float
        Wall time of the kernels until the device has finished [s], compilation included.
    prepare_seconds : float
        Wall time of preparation: geometry, maps, tables [s].
    notes : tuple of str
        What was left out or ignored, in a sentence each.
    """

    radiance: Image
    alpha: Image
    depth: Image
    normal: Image
    counts: NormalCounts
    seconds: float = 0.0
    prepare_seconds: float = 0.0
    notes: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        height, width = self.alpha.shape
        return f"Picture({width}×{height}, {self.alpha.mean():.0%} covered)"
