"""A bake's light in any projection, as tables and prefilters take it."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral_projection import OCTAHEDRAL
from rsibr.geometry.projections.projection import Projection
from rsibr.geometry.projections.sphere_image import Size, SphereImage, converted
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.radiance import Light


def light_in(light: Light, projection: Projection, size: Size, *, delta: bool = False) -> NDArray[np.float32]:
    """Mean radiance of a bake's light over each texel of a projection.

    Parameters
    ----------
    light : Light
        Light of the bake.
    projection : Projection
        Where directions lie.
    size : int or (int, int)
        Rows of a sheet, or rows and columns.
    delta : bool
        Whether to add the irradiance of lights without extent to the texel in whose direction they lie.

    Returns
    -------
    ndarray, shape (F, H, W, 3), float32
        Radiance [W sr⁻¹ m⁻²], scene-linear Rec.709.

    Examples
    --------
    >>> grey = Light(np.ones((16, 16, 3), np.float32))
    >>> from rsibr.geometry.projections.projection import projection
    >>> bool(np.allclose(light_in(grey, projection("cube"), 8), 1.0))
    True
    """
    source = SphereImage(OCTAHEDRAL, light.picture[None, ::-1])  # the picture has −Y at the top
    values = converted(source, projection, size).values
    return _with_delta(values, light.delta, projection) if delta and len(light.delta) else values


def _with_delta(values: NDArray[np.float32], delta: DeltaLights, projection: Projection) -> NDArray[np.float32]:
    """Add the irradiance of each light, divided by the solid angle of its texel."""
    columns, rows = projection.axes((values.shape[1], values.shape[2]))
    angles = projection.solid_angles(columns, rows).reshape(-1, 1)
    texels = np.array(projection.texel_of(mi.Vector3f(delta.directions.T), columns, rows))
    lit = values.astype(np.float64).reshape(-1, 3)
    np.add.at(lit, texels, delta.irradiance / angles[texels])
    return lit.reshape(values.shape).astype(np.float32)
