"""Reconstruction of the sphere map of one view from a bake."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.geometry.frame import unit_view, view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.job_size import JobSize
from rsibr.late import late
from rsibr.machine import make_folder
from rsibr.methods.job import OUTPUT_BYTES, maps_memory
from rsibr.methods.method_set import MethodSet
from rsibr.methods.protocol import Method
from rsibr.methods.registry import default_method, registration
from rsibr.methods.unbaked import unbaked, unfinished_config
from rsibr.store.bake import open_bake
from rsibr.store.image_kind import image_kind
from rsibr.store.map_file import MapFile, write_map
from rsibr.store.png_file import exposure_of, tone_mapped, write_png
from rsibr.store.stored_maps import StoredMaps


@dataclass(frozen=True, eq=False, repr=False)
class Reconstruction:
    """Reconstructed radiance sphere map of a view.

    Attributes
    ----------
    view : ndarray, shape (3,)
        Unit direction from the surface to the viewer.
    frame : ndarray, shape (3, 3)
        Columns x (right), y (up), z = view in world coordinates.
    image : ndarray, shape (N, N, 3), float32
        Radiance [W sr⁻¹ m⁻²], row 0 at the top; zero outside the disk.
    coverage : ndarray, shape (N, N)
        Share of each texel inside the disk.
    method : str
        Name of the method.
    seconds : float
        Wall time of the kernels until the device has finished [s]. Includes tracing and compilation in the first call
        of a process.
    prepare_seconds : float
        Wall time of the method's preparation, such as decoding maps and computing residuals [s]; spent once per bake.
    between_views : bool
        Whether the view lies between stored ones; false only for a capture that does not surround the sphere.
    """

    view: NDArray[np.float64]
    frame: NDArray[np.float64]
    image: NDArray[np.float32]
    coverage: NDArray[np.float64]
    method: str
    seconds: float
    prepare_seconds: float = 0.0
    between_views: bool = True

    def __repr__(self) -> str:
        x, y, z = self.view
        return f"Reconstruction({self.method!r}, view ({x:.3g}, {y:.3g}, {z:.3g}), {len(self.image)}²)"

    _repr_html_ = late("rsibr.publishing.notebooks.cards:map_card", "Card for a notebook.")

    def write(self, path: Path | str) -> None:
        """Write the map, as its name says: a multi-part EXR in float32, or an 8-bit PNG. A missing folder is made.

        Parameters
        ----------
        path : path
            `.exr`: R, G, B, then coverage, with view and frame in each header. `.png`: sRGB, exposed so that the 95th
            percentile of the disk is bright, transparent outside of it.

        Raises
        ------
        InputError
            If the name has another ending.
        """
        coverage, kind = self.coverage.astype(np.float32), image_kind(path)
        make_folder(Path(path).parent)
        if kind == "png":
            exposure = exposure_of(self.image[coverage >= 0.5].max(axis=-1))
            write_png(Path(path), tone_mapped(self.image, coverage, exposure))
        else:
            write_map(Path(path), MapFile(self.view, self.frame, {"radiance": self.image}, None, coverage))


@backend.in_session
def reconstruct(
    bake: StoredMaps | Path | str,
    view: ArrayLike,
    *,
    method: str | None = None,
    resolution: int | None = None,
    allow_large: bool = False,
) -> Reconstruction:
    """Reconstruct the map of a view that was not baked.

    Parameters
    ----------
    bake : Bake or path
        A finished bake; for methods that read no maps also the config of a scene (`.toml`) or an unfinished bake. To
        reconstruct many views, make a `MethodSet` once and call `run`.
    view : array_like, shape (3,)
        Direction from the surface to the viewer, of any positive length.
    method : str, optional
        Name of a method, one of `rsibr.method_names()`; by default `rsibr`, or `cabral1999` if the bake does not store
        lobes separately.
    resolution : int, optional
        Texels a side, 8 to 4096; by default that of the stored maps.
    allow_large : bool
        Start even if maps and result exceed the free memory.

    Returns
    -------
    Reconstruction
        Map, frame, and wall times.

    Raises
    ------
    InputError
        If the view has no direction, the method is unknown, the resolution out of range, or the memory too small.
    BakeError
        If the bake cannot be read, or lacks something that the method requires.

    Examples
    --------
    >>> paint = rsibr.reconstruct("out/paint.rsibr", view=(1, 2, 3))    # doctest: +SKIP
    >>> paint.image.shape                                                # doctest: +SKIP
    (256, 256, 3)
    """
    frame = view_frame(unit_view(view))
    made, side = prepared(bake, method, resolution, allow_large=allow_large)
    return run(made, frame, side)


@backend.in_session
def prepared(
    bake: StoredMaps | Path | str, method: str | None, resolution: int | None, *, allow_large: bool = False
) -> tuple[Method, int]:
    """Make a method for any number of views; return it with the texels a side. Parameters as for `reconstruct`."""
    opened = _opened(bake, method) if isinstance(bake, Path | str) else bake
    if resolution is not None and not 8 <= resolution <= 4096:
        raise InputError(f"{resolution} texels", where="resolution", fix="give 8 to 4096")
    side = resolution or opened.resolution
    memory = maps_memory(opened) + OUTPUT_BYTES * side**2
    JobSize(f"reconstruction at {side}²", memory=memory).admit(None, allow_large)
    return MethodSet(opened)[method or default_method(opened)], side


def _opened(path: Path | str, method: str | None) -> StoredMaps:
    """Open a bake, or load the scene of a config, or of an unfinished bake for a method that reads no maps."""
    if Path(path).suffix == ".toml":
        return unbaked(path, name=str(path))
    if method is not None and not registration(method).needs.stored_maps:
        config = unfinished_config(Path(path))
        if config is not None:
            return unbaked(config, name=str(path))
    return open_bake(Path(path))


@backend.in_session
def run(method: Method, frame: NDArray[np.float64], resolution: int) -> Reconstruction:
    """Run and time a method for one view.

    Parameters
    ----------
    method : Method
        From a `MethodSet`.
    frame : ndarray, shape (3, 3)
        Frame of the map, see `rsibr.geometry.frame.view_frame`.
    resolution : int
        Texels a side.

    Returns
    -------
    Reconstruction
    """
    before, start = method.cost.prepare_seconds, time.perf_counter()
    radiance = method.map(frame, resolution)
    dr.eval(radiance)
    backend.synchronize()
    seconds = time.perf_counter() - start
    coverage = texel_coverage(resolution)
    image = np.where(coverage[..., None] > 0, radiance.numpy()[..., :3], np.float32(0))
    preparing = method.cost.prepare_seconds - before
    views = getattr(method, "viewpoints", None)
    between = not isinstance(views, Viewpoints) or bool(views.covers(frame[:, 2]).all())
    spent, prepare_seconds = seconds - preparing, method.cost.prepare_seconds
    return Reconstruction(frame[:, 2].copy(), frame, image, coverage, method.name, spent, prepare_seconds, between)
