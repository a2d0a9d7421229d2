"""The light as the method stores it: nine coefficients and a filtered cube, made anew for each environment."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr import backend
from rsibr.light.harmonic_irradiance import HarmonicIrradiance
from rsibr.methods.kautz2003.cube_pyramid import CubePyramid
from rsibr.methods.kautz2003.faces import Faces, box_levels, checked
from rsibr.methods.kautz2003.nine_coefficients import FACE, coefficients
from rsibr.methods.kautz2003.phong_filter import phong_filtered


@dataclass(eq=False)
class KautzLight:
    """Filtered environment on the device.

    Attributes
    ----------
    diffuse : HarmonicIrradiance
        For diffuse reflection.
    glossy : CubePyramid
        Box-filtered pyramid, or one level filtered with Phong's lobe.
    """

    diffuse: HarmonicIrradiance
    glossy: CubePyramid

    @classmethod
    @backend.in_session
    def of(
        cls, faces: Faces, *, coefficients_face: int = FACE, borders: bool = False, exponent: float | None = None
    ) -> KautzLight:
        """Filter an environment.

        Parameters
        ----------
        faces : ndarray, shape (6, N, N, 3)
            Mean radiance [W sr⁻¹ m⁻²] over the texels of a cube (projection "cube"), N a power of two.
        coefficients_face : int
            Texels a side of the faces that the coefficients are computed from.
        borders : bool
            Whether glossy lookups are filtered across the borders of faces.
        exponent : float, optional
            Filter with Phong's lobe of this exponent instead of the box.
        """
        nine = HarmonicIrradiance.of(coefficients(checked(faces), coefficients_face))
        levels = box_levels(faces) if exponent is None else [phong_filtered(faces, exponent)]
        return cls(nine, CubePyramid.of(levels, seams=borders))

    def radiance(self, n: mi.Vector3f, r: mi.Vector3f, level: mi.Float) -> tuple[mi.Color3f, mi.Color3f]:
        """Radiance [W sr⁻¹ m⁻²] of a white diffuse and of a white glossy surface.

        Parameters
        ----------
        n, r : mi.Vector3f
            Unit normals, and unit directions of reflection.
        level : mi.Float
            Level of detail of the pyramid.
        """
        return self.diffuse.mean_radiance(n), self.glossy.lookup(dr.normalize(r), level)
