"""What a format is given: the reflection of one view, or the light of a bake."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.geometry.projections.disks import MIRROR_BALL, SPHERE_MAP
from rsibr.geometry.projections.projection import Projection
from rsibr.geometry.projections.sphere_image import Size, SphereImage, converted
from rsibr.geometry.projections.turned import Turned
from rsibr.light.radiance import Light
from rsibr.version import __version__

Image = NDArray[np.float32]

DIFFUSE, SPECULAR = "diffuse", "specular"
"""Passes of a view: its matte lobes, and all others."""

MAKER = f"rsibr {__version__}"
"""Program that writes the files, as they say it."""

_UNIT = "Scene-linear radiance [W sr^-1 m^-2], Rec.709 primaries; world right-handed, +Y up."


@dataclass(frozen=True, eq=False, repr=False)
class PublishedView:
    """Reflection of one view.

    Attributes
    ----------
    stem : str
        Beginning of the names of its files, such as `paint.view_0003`.
    name : str
        Name of the view among several, such as `view_0003`; empty for a single one.
    scene : str
        What is seen, such as `clearcoat-red under city`.
    source : str
        Where the map comes from: the name of a method, or `the stored map`.
    frame : ndarray, shape (3, 3)
        Columns x (right), y (up), z = the view in world coordinates.
    image : ndarray, shape (N, N, 3), float32
        Sphere map [W sr⁻¹ m⁻²], indexed by the normal, row 0 at the top; finite, zero outside the disk.
    coverage : ndarray, shape (N, N), float32
        Share of each texel inside the disk.
    passes : dict of str to ndarray, shape (N, N, 3), float32
        `image` in two parts, `DIFFUSE` and `SPECULAR`; empty where the lobes are not known apart, or no format of
        those asked for needs them.
    """

    stem: str
    name: str
    scene: str
    source: str
    frame: NDArray[np.float64]
    image: Image
    coverage: Image
    passes: Mapping[str, Image] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a map that is not finite."""
        for image in (self.image, *self.passes.values()):
            bad = int((~np.isfinite(image[self.coverage > 0]).all(axis=-1)).sum())
            if bad:
                fix = "see `rsibr check`, or use another --method"
                raise InputError(f"{bad} texels are not finite (NaN or infinite)", where=f"map of {self.stem}", fix=fix)

    def __repr__(self) -> str:
        x, y, z = self.view
        return f"PublishedView({self.stem!r}, view ({x:.3g}, {y:.3g}, {z:.3g}), {self.resolution}²)"

    @property
    def view(self) -> NDArray[np.float64]:
        """Unit direction from the surface to the viewer, shape (3,)."""
        return np.asarray(self.frame[:, 2])

    @property
    def resolution(self) -> int:
        """Texels a side of the sphere map."""
        return len(self.image)

    @cached_property
    def reflection(self) -> SphereImage:
        """L_r seen in this view by the mirror direction r in world coordinates: the sphere map as a mirror ball.

        The direction r = −v is that of the whole rim, where no texel lies: around it, the rim's texels are continued.
        """
        return SphereImage(Turned(MIRROR_BALL, self.frame), self.image[None])

    def in_projection(self, projection: Projection, size: Size) -> Image:
        """`reflection` in another projection, each texel the mean over its solid angle.

        Parameters
        ----------
        projection : Projection
            With directions in world coordinates.
        size : int or (int, int)
            Rows of a sheet, or rows and columns.

        Returns
        -------
        ndarray, shape (F, H, W, 3), float32
        """
        return converted(self.reflection, projection, size).values

    def filled(self, image: Image) -> Image:
        """Sphere map whose texels outside the disk continue those inside, so that a filter finds no dark rim."""
        return np.asarray(SphereImage(SPHERE_MAP, image[None]).values[0])

    @property
    def about(self) -> str:
        """What a file of this view holds, in ASCII."""
        view = ", ".join(f"{x:.6g}" for x in self.view)
        return (
            f"Reflection of one view only: {_ascii(self.scene)}, seen from v = ({view}), by {_ascii(self.source)}. "
            f"Right for this view and no other. {_UNIT}"
        )

    @property
    def about_directions(self) -> str:
        """What a file indexed by directions holds, in ASCII."""
        return (
            f"{self.about} Indexed by the mirror direction r: a surface with the normal n = (r + v)/|r + v| shows it. "
            "Around r = -v, which is seen at the rim alone, no texel was: the rim is continued there."
        )


@dataclass(frozen=True, eq=False, repr=False)
class PublishedLight:
    """Light of a bake, for formats that show no view.

    Attributes
    ----------
    stem : str
        Beginning of the names of its files.
    environment : str
        Name of the environment.
    light : Light
        The light itself.
    """

    stem: str
    environment: str
    light: Light

    def __repr__(self) -> str:
        return f"PublishedLight({self.stem!r}: {self.environment})"

    @property
    def about(self) -> str:
        """What a file of the light holds, in ASCII."""
        return f"The light of the bake, not a reflection: {_ascii(self.environment)}. {_UNIT}"


def _ascii(text: str) -> str:
    """Text of a user's in ASCII on one line."""
    return "".join(c if c.isprintable() else " " for c in text).encode("ascii", "replace").decode()
