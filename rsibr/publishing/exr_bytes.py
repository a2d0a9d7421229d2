"""OpenEXR files of one part for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.publishing.half_float import to_half
from rsibr.publishing.published_view import MAKER, PublishedView
from rsibr.store import exr
from rsibr.store.map_file import FRAME_KEY, VIEW_KEY


def encode_exr(
    view: PublishedView,
    passes: Mapping[str, NDArray[np.float32]],
    about: str,
    *,
    half: bool,
    attributes: Mapping[str, Any] | None = None,
) -> tuple[bytes, tuple[str, ...]]:
    """Encode images of one view: scan lines, ZIP, one part.

    Parameters
    ----------
    view : PublishedView
        The view; its name becomes the attribute `view`, which compositors go by.
    passes : dict of str to ndarray, shape (H, W, 3)
        Images by name; `""` for the channels R, G, B, otherwise `NAME.R`, `NAME.G`, `NAME.B`.
    about : str
        Attribute `comments`.
    half : bool
        float16 and not float32.
    attributes : dict, optional
        Further attributes, such as `envmap`.

    Returns
    -------
    data : bytes
        Equal input gives equal bytes.
    notes : tuple of str
        Values that were clamped.
    """
    channels: dict[str, NDArray[Any]] = {}
    notes: tuple[str, ...] = ()
    for name, image in passes.items():
        stored, told = to_half(image) if half else (np.asarray(image, np.float32), ())
        notes += told
        for k, colour in enumerate("RGB"):
            channels[f"{name}.{colour}" if name else colour] = stored[..., k]
    header: dict[str, Any] = {
        "software": MAKER,
        "comments": about,
        VIEW_KEY: np.ascontiguousarray(view.view, np.float32),
        FRAME_KEY: np.ascontiguousarray(view.frame, np.float32),
        **({"view": view.name} if view.name else {}),
        **(attributes or {}),
    }
    return exr.encode_exr(channels, header), notes
