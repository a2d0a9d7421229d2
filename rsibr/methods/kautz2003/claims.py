"""What Kautz, Daubert, Seidel (2003) claim without a figure, measured: each claim a function of an environment's faces.

Errors are relRMSE, √mean((a − b)² / (b² + ε)) with ε = (0.1 · mean b)², the root of the project's relMSE, over
directions even on the sphere. Faces are (6, N, N, 3) arrays of the projection "cube".
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import SphereImage, texel_directions, texel_solid_angles
from rsibr.light.harmonic_irradiance import HarmonicIrradiance
from rsibr.light.projected import light_in
from rsibr.light.radiance import light_of
from rsibr.lobes.band_factors import phong
from rsibr.methods.kautz2003.box_factors import bias_for
from rsibr.methods.kautz2003.cube_pyramid import CubePyramid
from rsibr.methods.kautz2003.faces import Faces, averaged, box_levels
from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.kautz2003.nine_coefficients import FACE, coefficients
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment

Array = NDArray[np.float64]

SIZE = 256
"""Texels a side of the faces that claims are measured with by default."""

_DIRECTIONS = 20000
_NORMALS = 2000
_QUADRATURE_FACE = 64
_BESIDE = 1e-5  # rad, from an edge of the cube to either side
_SUPERSAMPLING = 2


@backend.in_session
def environment_faces(file: Path | str, size: int = SIZE) -> NDArray[np.float32]:
    """Faces of an environment file, shape (6, size, size, 3): mean radiance [W sr⁻¹ m⁻²] over each texel."""
    light = light_of(load_environment(EnvironmentConfig(file=Path(file))), with_image=False)
    return light_in(light, projection("cube"), size)


def small_sun(size: int, direction: Array, sky: float = 0.0) -> NDArray[np.float32]:
    """Faces with a constant sky and one texel of radiance `size`² in a direction: the worst light for coarse tables.

    Parameters
    ----------
    size : int
        Texels a side; a texel of 256 is as large as the sun, 0.4°.
    direction : ndarray, shape (3,)
        Unit direction to the light.
    sky : float
        Radiance of the rest [W sr⁻¹ m⁻²].
    """
    cube = projection("cube")
    index = int(np.array(cube.texel_of(_vector(direction[None]), *cube.axes(size)))[0])
    faces = np.full((6 * size * size, 3), sky, dtype=np.float32)
    faces[index] = size**2
    return faces.reshape(6, size, size, 3)


@backend.in_session
def coefficients_error(faces: Faces, face: int = FACE) -> float:
    """Error of the diffuse radiance by coefficients from faces of `face`², against those from the faces given.

    Claim (section 5.1.1): 8×8 texels a face are enough for accurate results.
    """
    n = _vector(even_directions(_NORMALS))
    coarse, fine = (HarmonicIrradiance.of(coefficients(faces, side)) for side in (face, faces.shape[1]))
    return relative_error(_rows(coarse.mean_radiance(n)), _rows(fine.mean_radiance(n)))


@backend.in_session
def diffuse_error(faces: Faces) -> float:
    """Error of the diffuse radiance by nine coefficients, against quadrature of the clamped cosine (eq. 4).

    Claim (section 4.1): the first nine functions suffice.
    """
    n = even_directions(_NORMALS)
    nine = HarmonicIrradiance.of(coefficients(faces, faces.shape[1]))
    return relative_error(_rows(nine.mean_radiance(_vector(n))), lambert(faces, n))


@backend.in_session
def lambert(faces: Faces, n: Array) -> Array:
    """Radiance of a white Lambertian surface with normals `n` (K, 3) by quadrature, shape (K, 3)."""
    face, cube = min(_QUADRATURE_FACE, faces.shape[1]), projection("cube")
    d = np.array(texel_directions(cube, face), dtype=np.float64)
    energy = averaged(faces, face).reshape(-1, 3) * texel_solid_angles(cube, face).reshape(-1, 1)
    return np.asarray(np.maximum(n @ d, 0) @ energy / np.pi)


@backend.in_session
def box_error(faces: Faces, exponent: float, *, borders: bool = True) -> float:
    """Error of the box-filtered cube with the bias of an exponent, against the Phong-filtered cube.

    Claim (sections 4.2 and 6): the box filter looks much like Phong's.
    """
    d = _vector(even_directions(_DIRECTIONS))
    bias, _ = bias_for(phong(exponent), faces.shape[1])
    box = CubePyramid.of(box_levels(faces), seams=borders).lookup(d, mi.Float(bias))
    exact = KautzLight.of(faces, exponent=exponent, borders=True).glossy.lookup(d, mi.Float(0))
    return relative_error(_rows(box), _rows(exact))


@backend.in_session
def shift_variance(faces: Faces, bias: float, *, exponent: float | None = None, turns: int = 8) -> float:
    """Spread of glossy radiance over turns of the cube under a fixed environment, relative to its mean.

    Claim (section 4.2): the variation of the box kernel over the sphere can hardly be seen.

    Parameters
    ----------
    faces : ndarray, shape (6, N, N, 3)
        The environment.
    bias : float
        Level of detail of the box-filtered cube.
    exponent : float, optional
        Filter with Phong's lobe of this exponent instead: its kernel is the same everywhere, and what is left is the
        spread of resampling.
    turns : int
        Number of random turns.
    """
    rng = np.random.default_rng(1)
    d, source = even_directions(_DIRECTIONS), SphereImage(projection("cube"), faces)
    seen = []
    for _ in range(turns):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        light = KautzLight.of(_turned(source, turn, faces.shape[1]), exponent=exponent, borders=True)
        seen.append(_rows(light.glossy.lookup(_vector(d @ turn), mi.Float(bias))))
    mean = np.mean(seen, axis=0)
    return float(np.sqrt(np.mean([relative_error(one, mean) ** 2 for one in seen])))


def _turned(source: SphereImage, turn: Array, size: int) -> Faces:
    """Faces of a cube that stands turned in the environment."""
    fine = _SUPERSAMPLING * size
    points = np.array(texel_directions(projection("cube"), fine), dtype=np.float64).T @ turn.T
    return averaged(_rows(source.lookup(_vector(points))).reshape(6, fine, fine, 3), size)


def kernel_widths(size: int, bias: float) -> dict[str, float]:
    """Standard deviation [rad] of the box kernel at the centre of a face, at the middle of an edge and at a corner.

    Averaged over the places in a texel, the kernel's variance on the face is (2^b w)²/4 along each axis, w = 2/size;
    the standard deviation on the sphere, geometric mean of both axes, is its root times (1 + x² + y²)^(−3/4). Exact for
    whole b.
    """
    spread = 0.5 * 2.0**bias * 2 / size
    places = {"centre": 0, "edge": 1, "corner": 2}
    return {place: spread * (1 + squared) ** -0.75 for place, squared in places.items()}


@backend.in_session
def border_step(faces: Faces, bias: float, *, borders: bool) -> float:
    """Root mean square step of the box-filtered radiance across the cube's edges, relative to the mean radiance.

    Claim (section 6): with a high bias the six faces show, and filtering across faces avoids that.
    """
    pyramid = CubePyramid.of(box_levels(faces), seams=borders)
    inside, outside = (_rows(pyramid.lookup(_vector(side), mi.Float(bias))) for side in _beside_edges())
    step = float(np.sqrt(np.mean((inside - outside) ** 2)))
    return step / float(np.average(faces, axis=(0, 1, 2)).mean())


def relative_error(found: NDArray[np.floating[Any]], wanted: NDArray[np.floating[Any]]) -> float:
    """RelRMSE of radiance (K, 3), as in the module's head."""
    floor = (0.1 * wanted.mean(axis=0)) ** 2
    return float(np.sqrt(np.mean((found - wanted) ** 2 / (wanted**2 + np.maximum(floor, 1e-30)))))


def even_directions(count: int) -> Array:
    """Directions even on the sphere, a Fibonacci lattice, shape (count, 3)."""
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, np.pi * (1 + 5**0.5) * i
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)


def _beside_edges(points: int = 64) -> tuple[Array, Array]:
    """Directions on either side of the cube's twelve edges, each of shape (12 · points, 3)."""
    along = (np.arange(points) + 0.5) / points * 2 - 1
    inside, outside = list[Array](), list[Array]()
    for free in range(3):
        one, other = (free + 1) % 3, (free + 2) % 3
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            d = np.zeros((points, 3))
            d[:, free], d[:, one], d[:, other] = along, *signs
            for found, larger in ((inside, one), (outside, other)):
                moved = d.copy()
                moved[:, larger] *= 1 + _BESIDE
                found.append(moved / np.linalg.norm(moved, axis=1, keepdims=True))
    return np.concatenate(inside), np.concatenate(outside)


def _vector(rows: NDArray[np.floating[Any]]) -> mi.Vector3f:
    return mi.Vector3f(np.ascontiguousarray(rows.T, dtype=np.float32))


def _rows(colour: mi.Color3f) -> Array:
    return np.array(colour, dtype=np.float64).T
