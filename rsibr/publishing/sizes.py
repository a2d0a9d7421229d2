"""Sizes of published maps, as users give them or as the sphere map has the detail for."""

from __future__ import annotations

from rsibr.methods.options import power_of_two, whole

LEAST, MOST = 4, 8192
"""Limits of rows of a latitude–longitude map."""

MOST_FACE = 2048
"""Largest number of texels a side of a cube's face."""


def latlong_rows(size: int | None, resolution: int) -> int:
    """Rows of a latitude–longitude map: as given, or those of the sphere map.

    A texel at the equator is then π/4 as wide as one of the sphere map is on average: nothing is lost.
    """
    return resolution if size is None else whole("size", size, LEAST, MOST)


def face_texels(size: int | None, resolution: int) -> int:
    """Texels a side of a face: as given, or the power of two from half the sphere map's side.

    Of half its side, texels amid a face have the solid angle of those of the sphere map.
    """
    if size is not None:
        return power_of_two("size", size, MOST_FACE)
    return min(1 << max((resolution + 1) // 2 - 1, 1).bit_length(), MOST_FACE)
