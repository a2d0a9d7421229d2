"""Spectra for tests: a lamp of lines, and two surfaces of one colour under daylight."""

import colour
import numpy as np

GRID = np.arange(380.0, 781.0, 5.0)
OBSERVER = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(colour.SpectralShape(380, 780, 5))
DAYLIGHT = colour.SDS_ILLUMINANTS["D65"].copy().align(colour.SpectralShape(380, 780, 5)).values
CIE_Y = 106.7502593994140625  # sum of ȳ, as Mitsuba counts it: a unit spectrum has luminance 1


def spectrum(values, grid=GRID):
    return {"type": "spectrum", "value": [[float(w), float(v)] for w, v in zip(grid, values, strict=True)]}


def matte(values):
    return {"type": "diffuse", "reflectance": spectrum(values)}


def lines(*centres):
    """A lamp of narrow lines over a faint continuum."""
    return 0.05 + sum(3 * np.exp(-(((GRID - centre) / 6) ** 2)) for centre in centres)


def light(values):
    return {"type": "constant", "radiance": spectrum(values)}


def metamers():
    """Two reflectances of one colour under daylight: they differ by what the observer's three responses do not see."""
    base = 0.5 + 0.2 * np.sin((GRID - 380) / 60)
    seen = (OBSERVER.values * DAYLIGHT[:, None]).T
    wiggle = 0.3 * np.sin((GRID - 380) / 18) * np.exp(-(((GRID - 570) / 110) ** 2))
    unseen = wiggle - np.linalg.pinv(seen) @ (seen @ wiggle)
    return base, np.clip(base + unseen, 0, 1)


def seen_of(emission, reflectance):
    """Linear Rec.709 of light off a surface, both given on `GRID` and linear between: summed at 0.1 nm.

    The observer is given on `GRID` and linear between as well, as in Mitsuba: finer ones see 0.5 % more of a line.
    """
    fine = np.linspace(GRID[0], GRID[-1], 10 * int(GRID[-1] - GRID[0]) + 1)
    both = np.interp(fine, GRID, emission) * np.interp(fine, GRID, reflectance)
    xyz = [0.1 * (np.interp(fine, GRID, response) * both).sum() / CIE_Y for response in OBSERVER.values.T]
    return colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_XYZ_to_RGB @ xyz
