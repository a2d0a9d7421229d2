"""Interactions of the unit sphere against those of rays that hit Mitsuba's own sphere."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.sphere_interaction import interaction, sphere_interaction
from tests.arrays import to_numpy, unit_vectors, vector

VECTORS = ("p", "n", "wi", "dp_du", "dp_dv", "dn_du", "dn_dv")


def hit(n, v):
    """Interactions with Mitsuba's `sphere` at the points `n`, seen from `v`."""
    scene = mi.load_dict({"type": "scene", "sphere": {"type": "sphere"}})
    ray = mi.Ray3f(mi.Point3f(vector(n + v)), vector(-v))
    found = scene.ray_intersect(ray, mi.RayFlags.All | mi.RayFlags.dNGdUV, True)
    dr.eval(found)  # before the scene is gone
    return found


def seen(rng, n):
    v = n + 0.4 * unit_vectors(rng, len(n))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_interactions_are_those_of_mitsubas_sphere(rng):
    n = np.concatenate([unit_vectors(rng, 2000), [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [1e-4, -1e-4, 1]]])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    v = seen(rng, n)
    theirs = hit(n, v)
    ours = sphere_interaction(mi.Vector3f(theirs.n), vector(v))
    for name in VECTORS:
        assert to_numpy(getattr(ours, name)) == pytest.approx(to_numpy(getattr(theirs, name)), abs=3e-6), name
    for axis in "stn":
        expected = to_numpy(getattr(theirs.sh_frame, axis))
        assert to_numpy(getattr(ours.sh_frame, axis)) == pytest.approx(expected, abs=2e-6), axis
    assert np.abs(np.array(ours.uv) - np.array(theirs.uv)).max() < 1e-6


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_the_poles_have_a_frame_and_tangents_with_a_direction(z):
    si = sphere_interaction(mi.Vector3f(0, 0, z), mi.Vector3f(0, 0, z))
    frame = np.array([np.array(axis).ravel() for axis in (si.sh_frame.s, si.sh_frame.t, si.sh_frame.n)])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-7)
    assert np.array(si.wi).ravel() == pytest.approx([0, 0, 1])
    for tangent in (si.dp_du, si.dp_dv):
        assert np.linalg.norm(np.array(tangent)) > 1e-7


def test_the_local_frame_is_that_of_the_sphere_turned(rng):
    """The tangents in the frame of a point are those that `interaction` has at its texture coordinates."""
    n = unit_vectors(rng, 500)
    si = sphere_interaction(vector(n), vector(seen(rng, n)))
    local = interaction(si.wi, uv=si.uv)
    for name in ("dp_du", "dp_dv", "dn_du", "dn_dv"):
        turned = to_numpy(si.to_local(getattr(si, name)))
        assert turned == pytest.approx(to_numpy(getattr(local, name)) + 0 * turned, abs=4e-6), name
