"""Ways to make a picture: half floats, meshes, weights, and the bytes that they read."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.methods.device_size import device_bytes
from rsibr.methods.method_set import MethodSet
from rsibr.methods.protocol import PointwiseMethod
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import register, unregister
from rsibr.store.bake import open_bake
from rsibr.studies.agenda import Variant
from rsibr.studies.variants import opened_at, variant_of

FRAME = view_frame((1, 2, 3))


@pytest.fixture(scope="module")
def bake(small):
    return open_bake(next((small.out / "bakes").iterdir()))


@pytest.fixture(scope="module")
def methods(bake):
    return MethodSet(bake)


def picture(methods, *variant):
    return run(variant_of(methods, Variant(*variant, "float32")), FRAME, 16).image


def test_half_floats_are_rounded_and_never_infinite(bake, monkeypatch):
    stored = bake.map(0)
    bright = {name: np.where(image > 0, np.float32(1e6), image) for name, image in stored.layers.items()}
    rounded = opened_at(bake, "float16").map(0)
    for name, image in stored.layers.items():
        np.testing.assert_array_equal(rounded.layers[name], image.astype(np.float16).astype(np.float32))
        assert not np.array_equal(rounded.layers[name], image)
    monkeypatch.setattr("rsibr.store.bake.Bake.map", lambda self, index: replace(stored, layers=bright))
    assert max(image.max() for image in opened_at(bake, "float16").map(0).layers.values()) == 65504


def test_float32_is_the_bake_itself(bake):
    assert opened_at(bake, "float32") is bake


def test_a_mesh_comes_closer_to_the_exact_warp_the_finer_it_is(methods):
    """Linear interpolation: a quarter of the error for twice the rings, within 0.9 of the radius."""
    exact = picture(methods, "cabral1999", "texel", "area")
    centre = (np.arange(16) + 0.5) / 8 - 1
    inside = np.hypot(centre[:, None], centre) < 0.9
    meshes = [picture(methods, "cabral1999", f"mesh-{rings}x{3 * rings}", "area") for rings in (4, 8, 16, 32)]
    away = np.array([np.abs(mesh - exact)[inside].mean() for mesh in meshes])
    assert (away[:-1] > 2.5 * away[1:]).all()
    np.testing.assert_array_equal(
        picture(methods, "cabral1999", "mesh-16x48", "area"), run(methods["cabral1999-mesh"], FRAME, 16).image
    )


def test_weights_make_another_picture_and_a_methods_own_do_not(methods):
    assert variant_of(methods, Variant("rsibr", "texel", "gnomonic", "float32")) is methods["rsibr"]
    skewed = view_frame((1, 0.3, 0.1))
    gnomonic, area = (
        run(variant_of(methods, Variant("cabral1999", "texel", weights, "float32")), skewed, 16).image
        for weights in ("gnomonic", "area")
    )
    assert 0 < np.abs(gnomonic - area).mean() < 0.05 * area.mean()


def test_bytes_are_those_on_the_device(small):
    """The maps of the warp are 12 of 18 × 24 texels of 8 bytes; `rsibr` has its environment and tables beside them.

    The triangles of the views are listed in a grid of 64² cells, of ten bytes each.

    Where the belief of a bake mixes interpolation in, its tables come to as many bytes more.
    """
    paper = {point.bytes for point in small.points(method="cabral1999", warp="texel")}
    (least,) = paper
    assert 12 * 18 * 24 * 8 <= least < 1.1 * 12 * 18 * 24 * 8 + 10 * 64**2 + 4096
    baked = open_bake(sorted((small.out / "bakes").iterdir())[0])
    method = MethodSet(baked)["rsibr"]
    dr.eval(method.map(view_frame([1, 2, 3]), 16))
    found = {point.bytes for point in small.points(method="rsibr")}
    assert device_bytes(method) in found
    assert max(found) - min(found) < 2 * least
    assert device_bytes(method) >= method.cost.device_bytes > least


class Foreign(PointwiseMethod):
    """A method of another package: no dataclass, and its arrays lie in what all methods share."""

    def __init__(self, inputs):
        super().__init__(inputs)
        self.extra = dr.zeros(mi.Float, 1000)
        dr.eval(self.extra)
        _ = inputs.sources


def test_bytes_of_a_method_count_what_it_shares(bake):
    register("foreign", summary="test")(Foreign)
    try:
        made = MethodSet(bake)["foreign"]
        assert made.cost.device_bytes == 4000 + device_bytes(made.inputs.sources)
    finally:
        unregister("foreign")
