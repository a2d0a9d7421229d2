"""Smooth radiance in any projection, for tests."""

import numpy as np

from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import SphereImage, texel_directions
from tests.arrays import to_numpy


def smooth(d):
    """Three harmonics of the directions (..., 3), positive, none alike in two octants."""
    x, y, z = np.moveaxis(np.asarray(d, dtype=np.float64), -1, 0)
    return np.stack([2 + x, 2 + y + 0.5 * x * z, 1 + z * z + 0.3 * x * y], axis=-1)


def sampled(name, size):
    """`smooth` at the texels' centres."""
    to = projection(name)
    columns, rows = to.axes(size)
    values = smooth(to_numpy(texel_directions(to, size)).T)
    return SphereImage(to, values.reshape(to.sheets, rows.count, columns.count, 3))
