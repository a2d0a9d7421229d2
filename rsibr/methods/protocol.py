"""What every method offers: radiance for a normal and a view, whole sphere maps, and what it costs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.sphere_map import covered_middle, normal_from_disk, texel_centre, tiled_texels
from rsibr.methods.map_texels import as_rgba, frame_from, laid_out, touches_disk, view_of

if TYPE_CHECKING:
    from rsibr.methods.inputs import MethodInputs


@dataclass(frozen=True)
class Cost:
    """What a method costs before its first lookup.

    The time of a lookup depends on the size of the map and on the machine's state, so it is measured where it is used:
    `Reconstruction.seconds`, and `seconds` and `eval_seconds` of a validation.

    Attributes
    ----------
    bake_seconds : float
        Wall time of the bake that the method reads [s].
    bytes : int
        Size on disk of what it reads [bytes].
    prepare_seconds : float
        Wall time to make the method ready: decode maps and light, upload them, compute tables and residuals [s]. Work
        that several methods share counts in full for each of them.
    device_bytes : int
        Size of its arrays on the device [bytes].
    """

    bake_seconds: float = 0.0
    bytes: int = 0
    prepare_seconds: float = 0.0
    device_bytes: int = 0

    def preparing(self, seconds: float) -> Cost:
        """Return the same cost with `seconds` more of preparation."""
        return replace(self, prepare_seconds=self.prepare_seconds + seconds)


FREE = Cost()
"""Nothing was spent."""


@dataclass(frozen=True)
class Needs:
    """What a bake must hold for a method.

    Attributes
    ----------
    views : bool
        Maps of views all around, with the triangles between them.
    light : bool
        The light (`light.exr`).
    lobes : bool
        The material's lobes: their shapes and directional albedos.
    """

    views: bool = False
    light: bool = False
    lobes: bool = False


@runtime_checkable
class Method(Protocol):
    """A way to get the reflected radiance L_r(n, v) from a bake.

    Attributes
    ----------
    name : str
        As on the command line.
    cost : Cost
        What was spent before the first lookup.

    Examples
    --------
    >>> methods = rsibr.MethodSet(bake)                          # doctest: +SKIP
    >>> radiance = methods["rsibr"].eval(normals, views)         # doctest: +SKIP
    """

    name: str
    cost: Cost

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`.

        Parameters
        ----------
        n, v : mi.Vector3f
            Unit normals and unit view directions in world coordinates, one pair a lane, n·v ≥ 0.

        Returns
        -------
        mi.Color3f
            Radiance [W sr⁻¹ m⁻²], scene-linear Rec.709.
        """
        ...

    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.TensorXf:
        """Radiance of a whole sphere map; returns before the device has finished.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Columns x, y, z of the map's frame in world coordinates; z is the view direction.
        resolution : int
            Texels a side.

        Returns
        -------
        mi.TensorXf
            RGBA of shape (resolution, resolution, 4), row 0 at the top: radiance, and 1 where a texel may touch the
            disk; zero elsewhere.
        """
        ...


class PointwiseMethod:
    """Base of a method that is defined by its `eval`: a map is `eval` at the middle of what each texel has of the disk.

    Parameters
    ----------
    inputs : MethodInputs
        What the bake offers.

    Examples
    --------
    >>> @register("grey", summary="one grey for every surface and view")      # doctest: +SKIP
    ... class Grey(PointwiseMethod):
    ...     def eval(self, n, v):
    ...         return mi.Color3f(0.5)
    """

    name: str = ""
    cost: Cost = FREE

    def __init__(self, inputs: MethodInputs) -> None:
        self.inputs = inputs

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """See `Method.eval`."""
        raise NotImplementedError

    @backend.in_session
    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.TensorXf:
        """See `Method.map`."""
        columns = mi.Float(frame.T.ravel().tolist())
        dr.make_opaque(columns)  # the frame's numbers are no part of the kernel: another view compiles nothing
        to_world = frame_from(columns)
        texel = tiled_texels(resolution)
        p = texel_centre(texel, resolution)
        n = to_world @ normal_from_disk(covered_middle(p, resolution))
        radiance = dr.select(touches_disk(p, resolution), as_rgba(self.eval(n, view_of(to_world))), 0)
        return mi.TensorXf(laid_out(radiance, texel, resolution), (resolution, resolution, 4))
