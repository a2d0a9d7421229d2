"""Every projection: forward and inverse, solid angles, lookups across seams; and the directions of each by hand."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.projections.projection import projection, projection_names
from rsibr.geometry.projections.sphere_image import texel_directions, texel_solid_angles
from tests.arrays import point, to_numpy, unit_vectors, vector
from tests.geometry.projections.projected import sampled, smooth

NAMES = projection_names()
WHOLE = [name for name in NAMES if name != "sphere-map"]

AXES = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]

INVERSE = {"mirror-ball": 3e-4, "orthographic-pair": 4e-4, "sphere-map": 4e-4}
"""At the rim of these a step of float32 in p is √ of that in angle; 2e-6 elsewhere."""


@pytest.mark.parametrize("name", NAMES)
def test_direction_of_place_is_the_direction(name, rng):
    one = projection(name)
    d = np.concatenate([unit_vectors(rng, 20_000), AXES])
    d = d if one.covers_sphere else d[d[:, 2] >= 0]
    sheet, p = one.place(vector(d))
    assert to_numpy(p).min() > -1e-6
    assert to_numpy(p).max() < 1 + 1e-6
    assert np.abs(to_numpy(one.direction(sheet, p)).T - d).max() < INVERSE.get(name, 2e-6)


@pytest.mark.parametrize("name", NAMES)
def test_place_of_direction_is_the_place(name, rng):
    one = projection(name)
    sheet, p = rng.integers(0, one.sheets, 20_000), rng.uniform(0.001, 0.999, (20_000, 2))
    own = to_numpy(one.density(mi.UInt32(sheet.astype(np.uint32)), point(p))) > 0
    sheet, p = sheet[own], p[own]
    back, q = one.place(one.direction(mi.UInt32(sheet.astype(np.uint32)), point(p)))
    assert np.array_equal(np.array(back + dr.zeros(mi.UInt32, len(p))), sheet)
    assert np.abs(to_numpy(q).T - p).max() < 2e-5 if name.startswith(("latlong", "polar")) else 2e-6


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("size", [1, 2, 7, 32])
def test_solid_angles_sum_to_the_sphere(name, size):
    one = projection(name)
    total = 4 * np.pi if one.covers_sphere else 2 * np.pi
    assert texel_solid_angles(one, size).sum() == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "octahedral"])
def test_each_solid_angle_is_the_integral_of_the_density(name):
    """Sums of the density over 100² points a texel; an orthographic one is infinite at the rim."""
    one, size, fine = projection(name), 5, 100
    tolerance = 0.03 if name in ("orthographic-pair", "sphere-map") else 0.01
    columns, rows = one.axes(size)
    share = (np.arange(fine) + 0.5) / fine
    low, high = columns.edges()[:-1, None], columns.edges()[1:, None]
    x = (low + share * (high - low)).ravel()
    low, high = rows.edges()[:-1, None], rows.edges()[1:, None]
    y = (low + share * (high - low)).ravel()
    grid = np.stack([axis.ravel() for axis in np.meshgrid(x, y)], axis=1)
    area = np.repeat(np.diff(rows.edges()) / fine, fine)[:, None] * np.repeat(np.diff(columns.edges()) / fine, fine)
    for sheet in range(one.sheets):
        density = to_numpy(one.density(mi.UInt32(sheet), point(grid))).reshape(area.shape)
        summed = (density * area).reshape(rows.count, fine, columns.count, fine).sum(axis=(1, 3))
        assert np.abs(summed - texel_solid_angles(one, size)[sheet]).max() < tolerance * summed.mean()


@pytest.mark.parametrize("name", NAMES)
def test_the_density_is_that_of_the_directions(name, rng):
    """The cross product of finite differences of `direction`, away from rims and folds."""
    one, step = projection(name), 1e-3
    p = rng.uniform(0.02, 0.98, (5000, 2))
    p = p if name != "octahedral" else p[np.abs(np.abs(2 * p - 1).sum(axis=1) - 1) > 0.02]
    p = p[np.abs(p - 0.5).min(axis=1) > 0.01]
    p = p[np.hypot(*(2 * p - 1).T) < 0.95] if one.sheets < 6 and one.aspect == 1 and name != "octahedral" else p
    at = [to_numpy(one.direction(mi.UInt32(0), point(p + move))) for move in np.array(_STEPS) * step]
    across, down = (at[1] - at[0]).T, (at[3] - at[2]).T
    area = np.linalg.norm(np.cross(across, down), axis=1) / (2 * step) ** 2
    assert np.abs(to_numpy(one.density(mi.UInt32(0), point(p))) / area - 1).max() < 0.01


_STEPS = [[-1, 0], [1, 0], [0, -1], [0, 1]]


SEAMS = {
    "polar": 0.006,
    **dict.fromkeys(("latlong-filament", "latlong-debevec", "latlong-three"), 0.01),
    "dual-paraboloid": 0.015,
    "orthographic-pair": 0.07,
    "angular": 0.07,
    "mirror-ball": 0.3,
}
"""Jumps in a 16² image: at poles between texels, at rims on which two sheets interpolate each in its own plane, and at
-Z, into which a ball shrinks its whole rim. Elsewhere there is none but the step itself."""


@pytest.mark.parametrize("name", WHOLE)
def test_a_lookup_has_no_seam(name, rng):
    """Directions 1e-5 apart at the axes, the edges and corners of a cube, the rims and the date line."""
    image = sampled(name, 16)
    d = np.concatenate([AXES, unit_vectors(rng, 200), _seams(rng)])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    moved = d + 1e-5 * unit_vectors(rng, len(d))
    moved /= np.linalg.norm(moved, axis=1, keepdims=True)
    step = np.abs(to_numpy(image.lookup(vector(moved))) - to_numpy(image.lookup(vector(d)))).max(axis=0)
    assert step.max() < SEAMS.get(name, 1e-4)


def _seams(rng):
    along = rng.uniform(-1, 1, (300, 1))
    one, plane = np.ones_like(along), np.zeros_like(along)
    edges = [np.concatenate(parts, axis=1) for parts in ([along, one, one], [one, along, -one], [-one, -one, along])]
    lines = [np.concatenate(parts, axis=1) for parts in ([along, one, plane], [plane, along, one], [one, plane, along])]
    return np.concatenate([*edges, *lines, [[1, 1, 1], [-1, 1, -1]], [[0.3, 0, -1], [-0.3, 0, 1]]])


@pytest.mark.parametrize("name", WHOLE)
def test_a_lookup_converges_to_the_function(name, rng):
    """Mean error of a smooth function: half a texel's curvature, to the second order except where a rim is singular."""
    d = unit_vectors(rng, 4000)
    errors = [np.abs(to_numpy(sampled(name, size).lookup(vector(d))).T - smooth(d)).mean() for size in (16, 32, 64)]
    order = {"orthographic-pair": 0.5, "mirror-ball": 0.45}.get(name, 0.3)
    assert errors[2] < order * errors[1]
    assert errors[1] < order * errors[0]
    assert errors[2] < {"orthographic-pair": 4e-3, "mirror-ball": 5e-3}.get(name, 1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_the_nearest_texel_of_a_centre_is_its_own(name):
    """Where several centres show one direction, their values are equal too."""
    image = sampled(name, 8)
    columns, rows = image.axes
    x, y = np.meshgrid(columns.centres(), rows.centres())
    own = to_numpy(image.projection.density(mi.UInt32(0), point(np.stack([x.ravel(), y.ravel()], axis=1)))) > 0
    own = np.tile(own if name[:7] != "latlong" else np.ones_like(own), image.projection.sheets)
    found = to_numpy(image.nearest(texel_directions(image.projection, 8))).T
    assert np.abs(found - image.values.reshape(-1, 3))[own].max() < 1e-6


@pytest.mark.parametrize(
    ("name", "d", "sheet", "p"),
    [
        ("latlong", [0, 0, -1], 0, [0, 0.5]),
        ("latlong", [1, 0, 0], 0, [0.25, 0.5]),
        ("latlong", [0, 0, 1], 0, [0.5, 0.5]),
        ("latlong-openexr", [1, 0, 0], 0, [0.25, 0.5]),
        ("latlong-filament", [-1, 0, 0], 0, [0.25, 0.5]),
        ("latlong-filament", [0, 0, 1], 0, [0.5, 0.5]),
        ("latlong-debevec", [0, 0, -1], 0, [0.5, 0.5]),
        ("latlong-debevec", [1, 0, 0], 0, [0.75, 0.5]),
        ("latlong-three", [1, 0, 0], 0, [0.5, 0.5]),
        ("latlong-three", [0, 0, 1], 0, [0.75, 0.5]),
        ("polar", [0, 0, 1], 0, [0, 0.5]),
        ("polar", [1, 0, 0], 0, [0.25, 0.5]),
        ("polar", [0.6, 0.8, 0], 0, [0.25, np.arccos(0.8) / np.pi]),
        ("cube", [1, 0.5, -0.25], 0, [0.625, 0.25]),
        ("cube", [-1, 0.5, -0.25], 1, [0.375, 0.25]),
        ("cube", [0.5, 1, -0.25], 2, [0.75, 0.375]),
        ("cube", [0.5, -1, -0.25], 3, [0.75, 0.625]),
        ("cube", [0.5, -0.25, 1], 4, [0.75, 0.625]),
        ("cube", [0.5, -0.25, -1], 5, [0.25, 0.625]),
        ("octahedral", [0, 0, 1], 0, [0.5, 0.5]),
        ("octahedral", [0, 1, 0], 0, [0.5, 0]),
        ("dual-paraboloid", [1, 0, 0], 0, [1, 0.5]),
        ("dual-paraboloid", [0, 0.6, -0.8], 1, [0.5, 0.5 - 0.5 * 0.6 / 1.8]),
        ("orthographic-pair", [0.6, 0, -0.8], 1, [0.8, 0.5]),
        ("mirror-ball", [1, 0, 0], 0, [0.5 + np.sqrt(0.125), 0.5]),
        ("angular", [0, 1, 0], 0, [0.5, 0.25]),
        ("sphere-map", [0.6, 0, 0.8], 0, [0.8, 0.5]),
    ],
)
def test_directions_lie_where_the_convention_says(name, d, sheet, p):
    found, q = projection(name).place(dr.normalize(mi.Vector3f(d)))
    assert int(np.array(found).item()) == sheet
    assert to_numpy(q).ravel() == pytest.approx(p, abs=1e-6)


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(InputError, match=r"unknown projection 'latlon'\. Did you mean 'latlong'\?"):
        projection("latlon")
