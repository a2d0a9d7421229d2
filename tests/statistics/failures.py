"""What a failed statistical test leaves behind: the pictures to look at, as one multi-part EXR."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

FOLDER = Path(__file__).parents[2] / "out" / "failures"


@contextmanager
def kept_on_failure(name: str, folder: Path = FOLDER, **images: NDArray[np.floating]) -> Iterator[None]:
    """Save `images` where the block fails, and say where.

    Parameters
    ----------
    name : str
        Of the test; the file is `folder / NAME.exr`.
    **images : ndarray, shape (H, W) or (H, W, 3)
        Parts of the file, float32: the image, the reference, the variance, the p-values.
    """
    try:
        yield
    except AssertionError as error:
        path = folder / f"{re.sub(r'[^A-Za-z0-9._-]+', '_', name)}.exr"
        save(path, images)
        error.add_note(f"image, reference, variance and p-values: {path}")
        raise


def save(path: Path, images: dict[str, NDArray[np.floating]]) -> None:
    """Write the images as parts of one EXR, (H, W) as Y and (H, W, 3) as RGB."""
    path.parent.mkdir(parents=True, exist_ok=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part(dict(header), {"RGB" if image.ndim == 3 else "Y": np.ascontiguousarray(image, np.float32)}, name)
        for name, image in images.items()
    ]
    with OpenEXR.File(parts) as file:
        file.write(str(path))
