"""PNG files that say what they hold."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

from rsibr.publishing.published_view import MAKER, PublishedView
from rsibr.store.png_file import exposure_of, tone_mapped


def encode_picture(
    view: PublishedView, image: NDArray[np.float32], alpha: NDArray[np.float32], stops: float | None
) -> bytes:
    """Encode radiance as 8-bit sRGB.

    Parameters
    ----------
    view : PublishedView
        The view that is shown.
    image : ndarray, shape (N, N, 3)
        Radiance.
    alpha : ndarray, shape (N, N)
        Opacity.
    stops : float or None
        Exposure; 0: radiance 1 is white. None: the 95th percentile of the disk is bright. The file's text has the
        factor, and how many texels are brighter than white.
    """
    disk = view.coverage >= 0.5
    exposure = exposure_of(view.image[disk].max(axis=-1)) if stops is None else 2**stops
    clipped = int((view.image[disk] * exposure > 1).any(axis=-1).sum())
    told = f"radiance times {exposure:.4g}, sRGB; {clipped} of {int(disk.sum())} texels are brighter than white"
    return _encoded(tone_mapped(image, alpha, exposure), f"{view.about} This picture: {told}.")


def _encoded(picture: NDArray[np.uint8], about: str) -> bytes:
    from matplotlib.image import imsave  # noqa: PLC0415  # a quarter of a second that only those pay who need it

    stream = io.BytesIO()
    imsave(stream, picture, format="png", metadata={"Description": about, "Software": MAKER})
    return stream.getvalue()
