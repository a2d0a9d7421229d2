"""Spheres to look at beside the figures of `claims`: what each claim replaces, and what it puts there.

Each is the picture of a sphere in the parallel projection, shape (size, size, 3): radiance [W sr⁻¹ m⁻²], NaN outside.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.sphere_map import normal_from_disk, reflection_from_disk, texel_centres
from rsibr.light.harmonic_irradiance import HarmonicIrradiance
from rsibr.lobes.band_factors import phong
from rsibr.methods.kautz2003.box_factors import bias_for
from rsibr.methods.kautz2003.claims import lambert
from rsibr.methods.kautz2003.cube_pyramid import CubePyramid
from rsibr.methods.kautz2003.faces import Faces, box_levels
from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.kautz2003.nine_coefficients import FACE, coefficients

Array = NDArray[np.float64]

SIZE = 128


@backend.in_session
def matte_sphere(faces: Faces, size: int = SIZE) -> Array:
    """White Lambertian sphere by quadrature of the integral."""
    normals = np.array(normal_from_disk(texel_centres(size)), dtype=np.float64).T
    return _within(lambert(faces, normals), size)


@backend.in_session
def nine_term_sphere(faces: Faces, face: int = FACE, size: int = SIZE) -> Array:
    """White Lambertian sphere by nine coefficients, summed over faces of `face` texels a side."""
    nine = HarmonicIrradiance.of(coefficients(faces, face))
    return _picture(nine.mean_radiance(normal_from_disk(texel_centres(size))), size)


@backend.in_session
def phong_sphere(faces: Faces, exponent: float, size: int = SIZE) -> Array:
    """Sphere that reflects by Phong's lobe of an exponent."""
    mirrored = reflection_from_disk(texel_centres(size))
    light = KautzLight.of(faces, exponent=exponent, borders=True)
    return _picture(light.glossy.lookup(mirrored, mi.Float(0)), size)


@backend.in_session
def box_sphere(faces: Faces, bias: float, *, borders: bool = True, size: int = SIZE) -> Array:
    """Sphere that reflects by the box-filtered cube, at a bias of the level; with `borders` filtered across faces."""
    mirrored = reflection_from_disk(texel_centres(size))
    return _picture(CubePyramid.of(box_levels(faces), seams=borders).lookup(mirrored, mi.Float(bias)), size)


@backend.in_session
def box_bias(exponent: float, size: int) -> float:
    """Bias of the box that is nearest to Phong's lobe of an exponent, for faces of `size` texels a side."""
    return bias_for(phong(exponent), size)[0]


def _picture(radiance: mi.Color3f, size: int) -> Array:
    return _within(np.array(radiance, dtype=np.float64).T, size)


def _within(rows: Array, size: int) -> Array:
    inside = np.array(dr.squared_norm(texel_centres(size)) < 1)
    return np.where(inside[:, None], rows, np.nan).reshape(size, size, 3)
