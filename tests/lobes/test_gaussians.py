"""Mixtures of Gaussians over slopes: their parts, colours and kinds."""

import numpy as np
import pytest

from rsibr.lobes.gaussians import Gaussians, LobeShape
from tests import lobe_shapes


def test_a_mirror_has_facets_without_slope():
    shape = LobeShape.mirror()
    assert shape.is_mirror
    assert not shape.has_matte
    assert not shape.has_gaussians
    assert np.array_equal(shape.bare.sigmas, [0])
    assert np.array_equal(shape.bare.plain, np.ones((1, 3)))


def test_kinds_of_lobes_are_told_apart():
    glossy, coated, matte = lobe_shapes.ggx(0.1), lobe_shapes.coated(0.3), lobe_shapes.matte()
    assert [shape.has_gaussians for shape in (glossy, coated, matte)] == [True, True, False]
    assert [shape.has_matte for shape in (glossy, coated, matte)] == [False, False, True]
    assert not any(shape.is_mirror for shape in (glossy, coated, matte, lobe_shapes.one_gaussian(0.1)))


def test_between_takes_each_gaussian_once():
    bare = lobe_shapes.ggx(0.1).bare
    parts = [bare.between(0, 0.12), bare.between(0.12, np.inf)]
    assert np.array_equal(np.concatenate([part.sigmas for part in parts]), bare.sigmas)
    assert np.array_equal(np.concatenate([part.plain for part in parts]), bare.plain)
    assert parts[0].sigmas.max() < 0.12 <= parts[1].sigmas.min()
    assert len(Gaussians.none()) == 0


def test_a_colour_multiplies_all_weights():
    colour = np.array([0.5, 2.0, 0.0])
    shape = LobeShape(0.2, lobe_shapes.fresnel(0.1).bare, lobe_shapes.coated(0.3).coated, lobe_shapes.matte().matte)
    tinted = shape.tinted(colour)
    for before, after in (
        (shape.bare.plain, tinted.bare.plain),
        (shape.bare.grazing, tinted.bare.grazing),
        (shape.coated.plain, tinted.coated.plain),
        (shape.matte, tinted.matte),
    ):
        assert after == pytest.approx(before * colour)
    assert np.array_equal(tinted.bare.sigmas, shape.bare.sigmas)
    assert tinted.alpha == shape.alpha
