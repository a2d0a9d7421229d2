"""Tables that methods keep on the device, read back for a bundle: exactly those of the library."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.methods.cosine_table import CosineTable
from rsibr.publishing.bundle.encoding import Encoded, encoded


def sheets_of(texels: BorderedTexels) -> NDArray[np.float32]:
    """Sheets with their borders, shape (sheets, H + 2, W + 2, 3)."""
    height, width = (int(np.array(size)[0]) for size in (texels.height, texels.stride))
    return np.array(texels.texels, np.float32).reshape(-1, height, width, 4)[..., :3]


def table_of(table: CosineTable) -> Encoded:
    """Table by the cosine, shape (nodes, 4)."""
    return encoded(np.array(table.nodes, np.float32).reshape(-1, 4))


def numbers_of(value: Any) -> list[float]:
    """Numbers of a small Dr.Jit array, such as a colour."""
    return [float(one) for one in np.array(value, np.float64).ravel()]
