"""Interface of reconstruction methods: radiance for a normal and a view, whole sphere maps, cost."""

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
    """Cost of a method before its first lookup, and of a lookup once that was measured.

    The time of a whole map depends on its resolution. It is measured with each use: `Reconstruction.seconds`, and
    `seconds` of a validation.

    Attributes
    ----------
    bake_seconds : float
        Wall time of the bake [s]; without the rendering of its maps for a method that reads none of them.
    bytes : int
        Size on disk of the files that the method reads [bytes].
    prepare_seconds : float
        Wall time of preparation: decode maps and environment, upload them, compute tables and residuals [s]. Work
        shared by several methods counts in full for each of them.
    device_bytes : int
        Size of the method's arrays on the device [bytes].
    reads_maps : bool
        Whether the method reads stored maps.
    lookup_seconds : float or None
        Time of one lookup by `eval` in a large launch [s]; None until a validation, a study or a comparison has
        measured it (`rsibr.validation.eval_error.judge_eval`).
    """

    bake_seconds: float = 0.0
    bytes: int = 0
    prepare_seconds: float = 0.0
    device_bytes: int = 0
    reads_maps: bool = False
    lookup_seconds: float | None = None

    def preparing(self, seconds: float) -> Cost:
        """Return the cost with `seconds` added to the preparation time."""
        return replace(self, prepare_seconds=self.prepare_seconds + seconds)


FREE = Cost()
"""Zero cost."""


@dataclass(frozen=True)
class Needs:
    """Parts of a bake that a method requires.

    Attributes
    ----------
    views : bool
        Maps of views that cover the sphere, with their triangulation.
    maps : bool
        At least one map; `views` implies it.
    light : bool
        Environment (`light.exr`).
    lobes : bool
        Lobes of the material: shapes and directional albedos.
    """

    views: bool = False
    light: bool = False
    lobes: bool = False
    maps: bool = False

    @property
    def stored_maps(self) -> bool:
        """Whether the method reads any stored map."""
        return self.views or self.maps


@runtime_checkable
class Method(Protocol):
    """Reconstruction of the reflected radiance L_r(n, v) from a bake.

    Attributes
    ----------
    name : str
        Name on the command line.
    cost : Cost
        Cost before the first lookup.

    Examples
    --------
    >>> methods = rsibr.MethodSet(bake)                          # doctest: +SKIP
    >>> radiance = methods["rsibr"].eval(normals, views)         # doctest: +SKIP
    """

    name: str
    cost: Cost

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance L_r(n, v) toward `v` from surfaces with normal `n`.

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
        """Radiance of a whole sphere map. Asynchronous: returns before the device has finished.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Columns x, y, z of the map's frame in world coordinates; z is the view direction.
        resolution : int
            Texels a side.

        Returns
        -------
        mi.TensorXf
            RGBA of shape (resolution, resolution, 4), row 0 at the top: radiance [W sr⁻¹ m⁻²], and 1 where a texel may
            overlap the disk; zero elsewhere.
        """
        ...


class PointwiseMethod:
    """Base class of methods defined by `eval`: a map is `eval` at the middle of each texel's part inside the disk.

    Parameters
    ----------
    inputs : MethodInputs
        Maps, environment and lobes of the bake.

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
        dr.make_opaque(columns)  # the frame is an input of the kernel, so that another view compiles nothing
        to_world = frame_from(columns)
        texel = tiled_texels(resolution)
        p = texel_centre(texel, resolution)
        n = to_world @ normal_from_disk(covered_middle(p, resolution))
        radiance = dr.select(touches_disk(p, resolution), as_rgba(self.eval(n, view_of(to_world))), 0)
        return mi.TensorXf(laid_out(radiance, texel, resolution), (resolution, resolution, 4))
