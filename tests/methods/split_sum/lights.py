"""Lights for tests of the split-sum method, as point sources, and their prefiltered radiance by brute force."""

import numpy as np

from rsibr.geometry.projections.octahedral import texel_directions
from rsibr.light.radiance import Light
from rsibr.methods.split_sum.ggx_kernel import GGXKernel

RESOLUTION = 192


def unit_texels(resolution=RESOLUTION):
    """Directions of an octahedral image in float64, (R², 3)."""
    d = np.array(texel_directions(resolution), dtype=np.float64).T
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def light_of(radiance, resolution=RESOLUTION):
    """Light whose radiance is a function of directions (n, 3) → (n, 3)."""
    values = np.broadcast_to(radiance(unit_texels(resolution)), (resolution**2, 3))
    return Light(values.reshape(resolution, resolution, 3).astype(np.float32))


def lamps(d):
    """High contrast at all scales: strong narrow lamps over a structured sky, three unlike channels."""
    sky = 0.2 + 0.1 * np.sin(9 * d[:, :1]) * np.cos(7 * d[:, 1:2])
    total = np.repeat(sky, 3, axis=1) * [1.0, 0.8, 0.5]
    for axis, width, colour in (
        ((0.8, 0.1, 0.59), 0.03, (300, 200, 100)),
        ((-0.3, 0.9, -0.3), 0.1, (5, 9, 20)),
        ((-0.58, -0.58, 0.57), 0.02, (50, 400, 50)),
    ):
        middle = np.array(axis) / np.linalg.norm(axis)
        total = total + np.exp((d @ middle - 1) / width**2)[:, None] * np.array(colour)
    return total


def sun(d, place=(0.57, 0.6, 0.56), radiance=1e6, sky=1e-2):
    """A sun of one texel over a faint sky."""
    total = np.full((len(d), 3), sky)
    total[np.argmax(d @ np.array(place))] = radiance
    return total


def brute(sources, alpha, places):
    """∫ K L dω / ∫ K dω at unit directions, in float64, one source after the other."""
    kernel, rows = GGXKernel(alpha), []
    for place in places:
        weighed = kernel.value(((sources.directions - place) ** 2).sum(axis=1) / 4) @ sources.weights
        rows.append(weighed[:3] / weighed[3])
    return np.array(rows)


def band_factors(alpha, count):
    """Factors of the bands 0 … count − 1 of spherical harmonics: ∫ K P_l dω / ∫ K dω, by quadrature over s."""
    x, weight = np.polynomial.legendre.leggauss(400)
    square = alpha**2  # nodes even in log(α² + b s), where K is a power law
    low, high = np.log(square), np.log(square + (1 - square) / 2)
    base = np.exp(low + (x + 1) / 2 * (high - low))
    s = (base - square) / (1 - square)
    moments = (weight * base * GGXKernel(alpha).value(s)) @ np.polynomial.legendre.legvander(1 - 2 * s, count - 1)
    return moments / moments[0]
