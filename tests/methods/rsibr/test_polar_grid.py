"""The polar grid: exact at its nodes, bilinear between them, without a seam."""

import mitsuba as mi
import numpy as np

from rsibr.methods.rsibr.polar_grid import RINGS, SECTORS, PolarGrid
from tests.arrays import to_numpy, vector


def normal(angle, azimuth):
    return vector(np.stack([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=-1))


def of(function):
    """Two grids of three channels each, (angle, azimuth) → six values."""
    n = to_numpy(PolarGrid.normals())
    values = function(np.arccos(np.clip(n[2], 0, 1)), np.arctan2(n[1], n[0]))
    parts = values[:3], values[3:]
    return [PolarGrid.of(mi.Color3f(*(mi.Float(v.astype(np.float32)) for v in part))) for part in parts]


def looked_up(grids, angle, azimuth):
    return np.concatenate([to_numpy(grid.lookup(normal(angle, azimuth))) for grid in grids])


def waves(angle, azimuth):
    return np.stack([1 + 0 * angle, angle, angle * np.cos(azimuth), angle * np.sin(azimuth), np.cos(angle), 2 - angle])


def test_nodes_come_back():
    n = PolarGrid.normals()
    angle, azimuth = np.arccos(np.clip(to_numpy(n)[2], 0, 1)), np.arctan2(*to_numpy(n)[1::-1])
    assert np.abs(looked_up(of(waves), angle, azimuth) - waves(angle, azimuth)).max() < 5e-4  # of the angle's rounding


def test_what_is_linear_in_the_angle_is_exact_and_the_rest_nearly(rng):
    angle, azimuth = rng.uniform(0.01, np.pi / 2, 5000), rng.uniform(-np.pi, np.pi, 5000)
    error = np.abs(looked_up(of(waves), angle, azimuth) - waves(angle, azimuth))
    assert error[[0, 1, 5]].max() < 5e-4
    step = max(np.pi / 2 / RINGS, 2 * np.pi / SECTORS)
    assert error.max() < step**2 / 8 * np.pi / 2 + 5e-4  # the bound of linear interpolation


def test_there_is_no_seam_and_the_rim_belongs_to_it():
    angle = np.linspace(0, np.pi / 2, 50)
    before, after, zero = (looked_up(of(waves), angle, np.full(50, a)) for a in (-np.pi + 1e-6, np.pi - 1e-6, -1e-6))
    assert np.abs(before - after).max() < 1e-4
    assert np.abs(zero - looked_up(of(waves), angle, np.full(50, 1e-6))).max() < 1e-4
    for grid in of(waves):
        assert np.isfinite(to_numpy(grid.lookup(mi.Vector3f(1.0000001, 1e-4, 0)))).all()  # rounding may lead there
