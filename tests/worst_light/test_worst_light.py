"""The worst lamps: what must hold in each zone of the disk, for every material and both of our methods.

`python -m tests.worst_light` prints what the bounds are held against.
"""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import icosphere
from rsibr.light.radiance import RESOLUTION as LIGHT_RESOLUTION
from tests.arrays import vector
from tests.worst_light.judged import RESOLUTION, Room, by_zone, root_mean_square, true_change
from tests.worst_light.scenes import (
    EDGE,
    GRAZING,
    HORIZON,
    LAMP,
    MATERIALS,
    PINPOINT,
    SCENES,
    SMALL,
    STORED,
    A,
    B,
    C,
    D,
    beside,
    mirrors,
)

BRIGHTEST = 2.0
"""Brightest channel of a map over that of the truth: more would be seen as a light that is not there."""

MOST_HOLES = 0.006
"""Share of the disk that may show less than a quarter of the true radiance."""

ENERGY = {"inner": 0.03, "middle": 0.1, "rim": 0.2}
"""By how much the energy of a zone may be off, beyond the noise of the truth."""

GOOD = 7e-3
"""relMSE below which it does not matter whether `cabral1999` errs less: 8 % of the radiance."""

STEP = 1e-3
"""Distance from an edge at which a view is on either side of it [rad]."""

FASTEST = 8.0
"""How many times as fast as the truth a map may change with the view."""

each_method = pytest.mark.parametrize("method", ["rsibr", "rsibr-fine"])
each_material = pytest.mark.parametrize("material", MATERIALS)
each_edge = pytest.mark.parametrize(("edge", "third"), [("beside the lamp", A), ("in its plane", C)], ids=["BC", "AB"])


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return Room(tmp_path_factory.mktemp("worst_light"))


def broken_bounds(ours, baseline):
    """Say which bounds the errors of a map break, given those of `cabral1999`."""
    if ours.brightest > BRIGHTEST:
        yield f"{ours.brightest:.2f} times the brightest truth"
    if ours.holes > MOST_HOLES:
        yield f"{ours.holes:.2%} holes"
    for zone, most in ENERGY.items():
        low, high = ours.energy[zone].ci95
        if low > 1 + most or high < 1 - most:
            yield f"{zone}: energy {ours.energy[zone]}"
        if ours.rel_mse[zone].ci95[0] > max(baseline.rel_mse[zone].ci95[1], GOOD):
            yield f"{zone}: relMSE {ours.rel_mse[zone]}, cabral1999 {baseline.rel_mse[zone]}"


def check(room, scene, material, method):
    """Every view of a scene; a map that is not finite raises CheckFailed."""
    lit, found = room.lit(scene, material), []
    for name, view in SCENES[scene].views.items():
        broken = broken_bounds(lit.errors(method, view), lit.errors("cabral1999", view))
        found += [f"{name}: {line}" for line in broken]
    assert not found, "\n".join(found)


@pytest.mark.slow
@each_method
@each_material
def test_a_lamp_smaller_than_a_texel(room, material, method):
    """In the light map, on its seam, and in the maps. Bounds hold at the near end of the interval of 95 %."""
    check(room, SMALL, material, method)


@pytest.mark.slow
@each_method
@each_material
def test_a_lamp_seen_at_grazing_angles_only(room, material, method):
    """By the new view and by the stored view beside it; the highlight lies in the outermost texels."""
    check(room, GRAZING, material, method)


@pytest.mark.slow
@each_method
@each_material
def test_a_highlight_behind_the_horizon_of_stored_views(room, material, method):
    """Of one and of two of the three: they do not see the part of the surface that shines."""
    check(room, HORIZON, material, method)


@pytest.mark.slow
@each_method
@each_material
def test_a_view_on_an_edge(room, material, method):
    """Midway between two stored views; the third sees the lamp at its rim, or the lamp lies in the edge's plane."""
    check(room, EDGE, material, method)


@pytest.mark.slow
@each_material
def test_the_truth_keeps_every_bound(room, material):
    """Rendered once more with other random numbers: what breaks a bound is not noise."""
    for scene, made in SCENES.items():
        lit = room.lit(scene, material)
        for name, view in made.views.items():
            again = lit.renderer.render(view_frame(view), lit.truth_samples, seed=8).mean
            broken = list(broken_bounds(by_zone(again, lit.truth(view), name), lit.errors("cabral1999", view)))
            assert not broken, (scene, name, broken)


@pytest.mark.slow
def test_a_bound_breaks_where_a_map_is_wrong(room):
    """Truth with a tenth more light, a black patch, or one texel three times as bright as all others."""
    lit, view = room.lit(HORIZON, "plastic"), SCENES[HORIZON].views["of two views"]
    truth, baseline = lit.truth(view), lit.errors("cabral1999", view)
    patch, spark = truth.mean.copy(), truth.mean.copy()
    patch[20:24, 20:24] = 0
    spark[24, 24] = 3 * truth.mean.max()
    said = [
        " ".join(broken_bounds(by_zone(image, truth, "wrong"), baseline)) for image in (truth.mean * 1.1, patch, spark)
    ]
    assert "inner: energy" in said[0]
    assert "holes" in said[1]
    assert "brightest" in said[2]


def change(room, material, method, edge, third, step):
    """Root mean square of the difference between the maps at `step` on either side of the edge."""
    lit, view = room.lit(EDGE, material), SCENES[EDGE].views[edge]
    one, other = (lit.map(method, beside(view, third, sign * step)) for sign in (1, -1))
    return root_mean_square(one - other, lit.truth(view))


@pytest.mark.slow
@each_edge
@each_method
@each_material
def test_an_edge_is_crossed_without_a_jump(room, material, method, edge, third):
    """From 1e-3 rad on one side to as much on the other, the map's change is in proportion to the distance."""
    near, far = (change(room, material, method, edge, third, step) for step in (STEP / 10, STEP))
    assert near < 0.15 * far


@pytest.mark.slow
@each_edge
@each_method
@each_material
def test_a_map_follows_the_view_no_faster_than_the_truth(room, material, method, edge, third):
    """At most `FASTEST` times as fast: more is a shimmer.

    The truth's own change is measured over ten times the distance, where it stands out from its noise; it is
    proportional to the distance within 10 % up to 4e-2 rad.
    """
    lit, view, far = room.lit(EDGE, material), SCENES[EDGE].views[edge], 10 * STEP
    true = true_change(*(lit.truth(beside(view, third, sign * far)) for sign in (1, -1))) * (STEP / far)
    assert change(room, material, method, edge, third, STEP) < FASTEST * true


def degrees(a, b):
    return np.degrees(np.arccos(a @ b))


def around(view):
    """Stored views of the triangle that contains `view`."""
    found = icosphere(0).surrounding(mi.Vector3f(vector([view])))
    return STORED[np.array([int(index[0]) for index in found])]


def test_the_pinpoint_is_smaller_than_every_texel():
    """Of the light map in solid angle, by four times, and of the sphere maps; and it lies on the light map's seam."""
    image = PINPOINT.image()
    shining = image[..., 0] > 1
    assert shining.sum() == 1
    height, width = PINPOINT.shape
    solid_angle = (np.pi / (height - 1)) * (2 * np.pi / width)  # on the equator
    assert np.flatnonzero(shining.any(axis=1)) == (height - 1) / 2
    assert solid_angle < 4 * np.pi / LIGHT_RESOLUTION**2 / 4
    assert np.sqrt(solid_angle) < 4 / RESOLUTION / 20  # normals of a texel reflect into twice the angle
    assert PINPOINT.direction[1] == 0
    assert PINPOINT.direction[2] < 0


@pytest.mark.parametrize("lamp", [LAMP, PINPOINT], ids=["lamp", "pinpoint"])
def test_lamps_have_their_irradiance(lamp):
    """By a sum over the texels, on a surface that faces the lamp: 3 W m⁻² above the sky."""
    image = lamp.image()
    height, width = lamp.shape
    rows = np.sin(np.pi * np.arange(height) / (height - 1)) * (np.pi / (height - 1)) * (2 * np.pi / width)
    assert ((image - image.min(axis=(0, 1))) * rows[:, None, None]).sum(axis=(0, 1)) == pytest.approx([3.0] * 3)


def test_grazing_views_see_the_lamp_at_eighty_degrees_and_more():
    lamp = LAMP.direction
    assert degrees(mirrors(lamp, A), A) == pytest.approx(85)
    for view in SCENES[GRAZING].views.values():
        assert degrees(mirrors(lamp, view), view) > 79.9
        assert degrees(view, A) < 10.1


@pytest.mark.parametrize(("name", "behind"), [("of one view", 1), ("of two views", 2)])
def test_horizons_hide_the_place_of_the_highlight(name, behind):
    view = SCENES[HORIZON].views[name]
    assert (around(view) @ mirrors(LAMP.direction, view) < 0).sum() == behind


@each_edge
def test_edges_have_different_third_views_on_their_sides(edge, third):
    view = SCENES[EDGE].views[edge]
    this, other = (around(beside(view, third, sign * STEP)) for sign in (1, -1))
    assert (this @ third > 1 - 1e-12).any()
    assert not (other @ third > 1 - 1e-12).any()


def test_the_lamp_lies_in_the_plane_of_one_edge_and_behind_the_third_view_of_the_other():
    assert np.cross(A, B) @ LAMP.direction == pytest.approx(0, abs=1e-12)
    assert degrees(LAMP.direction, -A) == pytest.approx(10)
    assert degrees(B, C) == pytest.approx(degrees(C, D)) == pytest.approx(degrees(B, D))
