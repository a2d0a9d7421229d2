"""Shapes in the manifest: kept to six digits, refused where they contradict themselves, and made for older bakes."""

import numpy as np
import pytest

from rsibr.lobes.albedo import NODES
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.probe_directions import probe_directions
from rsibr.lobes.shape_fit import angle_errors, shape_values
from rsibr.lobes.split import MIRROR
from rsibr.store.consistency import _check_lobe
from rsibr.store.lobe_shape import shape_of, shape_record
from rsibr.store.manifest import GaussianRecord, LobeRecord, ProxyRecord, ShapeRecord
from tests import lobe_shapes, microfacet

ALBEDO = tuple((0.5, 0.5, 0.5) for _ in range(NODES))


def lobe(shape, alpha=0.1, coefficients=((0.5, 0.5, 0.5), (0.1, 0.1, 0.1), (0.0, 0.0, 0.0))):
    proxies = (ProxyRecord(alpha=alpha, coefficients=coefficients),)
    return LobeRecord(name="glossy", alpha=alpha, albedo=ALBEDO, proxies=proxies, shape=shape)


def everything():
    """A shape with terms of all kinds."""
    bare = Gaussians(
        np.array([0.01, 0.2]),
        np.array([[0.1, 0.2, 1 / 3], [0.0, 0.4, 0.5]]),
        np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]),
    )
    coated = Gaussians(np.array([0.3]), np.array([[0.7, 0.8, 0.9]]), np.zeros((1, 3)))
    return LobeShape(0.123456789, bare, coated, np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 1e-7]]))


@pytest.mark.parametrize(
    "shape",
    [everything, lambda: lobe_shapes.fresnel(0.1), lambda: lobe_shapes.coated(0.3)],
    ids=["everything", "dielectric", "coated"],
)
def test_a_shape_comes_back_to_six_digits(shape):
    made = shape()
    record = ShapeRecord.model_validate_json(shape_record(made).model_dump_json())
    found = shape_of(lobe(record))
    assert found.alpha == pytest.approx(made.alpha, rel=5e-6)
    for before, after in ((made.bare, found.bare), (made.coated, found.coated)):
        for name in ("sigmas", "plain", "grazing"):
            assert getattr(after, name) == pytest.approx(getattr(before, name), rel=5e-6)
            assert getattr(after, name).shape == getattr(before, name).shape
    assert found.matte == pytest.approx(made.matte, rel=5e-6)
    assert shape_record(found) == record
    _check_lobe(lobe(record), "lobes.0")


def test_a_delta_lobe_has_no_record_and_comes_back():
    assert shape_record(LobeShape.mirror()) is None
    record = LobeRecord(name="mirror", alpha=MIRROR, albedo=ALBEDO)
    assert shape_of(record).is_mirror
    _check_lobe(record, "lobes.0")


SOUND = {
    "alpha": 0.1,
    "bare": [{"sigma": 0.1, "plain": [1, 1, 1], "grazing": [0, 0, 0]}],
    "coated": [{"sigma": 0.2, "plain": [1, 1, 1], "grazing": [0, 0, 0]}],
    "matte": [[0, 0, 0], [0, 0, 0]],
}
ONE = SOUND["bare"][0]
REFUSED = [
    ("alpha: 0 is no roughness", {"alpha": 0.0}),
    ("alpha: 1.01 is no roughness", {"alpha": 1.01}),
    ("alpha: nan is no roughness", {"alpha": float("nan")}),
    ("bare: too many Gaussians", {"bare": [{**ONE, "sigma": 0.1 + 0.01 * k} for k in range(65)]}),
    ("bare: .*not in order", {"bare": [{**ONE, "sigma": 0.2}, ONE]}),
    ("coated: .*not in order", {"coated": [ONE, ONE]}),
    ("bare: .*not in order", {"bare": [{**ONE, "sigma": 0.0}]}),
    ("bare: .*not in order", {"bare": [{**ONE, "sigma": float("nan")}]}),
    ("bare: width out of range", {"bare": [{**ONE, "sigma": 5e-5}]}),
    ("coated: width out of range", {"coated": [{**ONE, "sigma": 11.0}]}),
    ("bare: weights out of range", {"bare": [{**ONE, "plain": [1, -1e-9, 1]}]}),
    ("bare: weights out of range", {"bare": [{**ONE, "grazing": [0, 0, 1e7]}]}),
    ("coated: weights out of range", {"coated": [{**ONE, "plain": [0, float("nan"), 0]}]}),
    ("matte: out of range", {"matte": [[0, 0, 0], [0, -0.1, 0]]}),
    ("matte: out of range", {"matte": [[float("inf"), 0, 0], [0, 0, 0]]}),
]


def test_a_sound_shape_passes():
    _check_lobe(lobe(ShapeRecord.model_validate(SOUND)), "lobes.0")
    _check_lobe(lobe(ShapeRecord.model_validate({**SOUND, "bare": [], "coated": []})), "lobes.0")
    _check_lobe(lobe(ShapeRecord.model_validate({**SOUND, "alpha": 1.0})), "lobes.0")


@pytest.mark.parametrize(("says", "change"), REFUSED)
def test_a_shape_that_cannot_be_is_refused(says, change):
    """Each guard; numbers that JSON cannot hold too."""
    record = ShapeRecord.model_construct(**_fields({**SOUND, **change}))
    with pytest.raises(ValueError, match=rf"^lobes\.0\.shape\.{says}"):
        _check_lobe(lobe(None).model_copy(update={"shape": record}), "lobes.0")


def _fields(values):
    """The fields of a record, unchecked: a NaN is no valid number to its type."""
    mixtures = {
        name: tuple(
            GaussianRecord.model_construct(sigma=one["sigma"], plain=tuple(one["plain"]), grazing=tuple(one["grazing"]))
            for one in values[name]
        )
        for name in ("bare", "coated")
    }
    return {**values, **mixtures, "matte": tuple(tuple(row) for row in values["matte"])}


def test_a_delta_lobe_with_a_shape_is_refused():
    record = LobeRecord(name="mirror", alpha=MIRROR, albedo=ALBEDO, shape=ShapeRecord.model_validate(SOUND))
    with pytest.raises(ValueError, match=r"lobes\.0\.shape: is not that of a delta lobe"):
        _check_lobe(record, "lobes.0")


def test_a_lobe_of_an_older_bake_has_the_shape_of_its_proxy():
    """Without a shape: 0.5 GGX + 0.1 times that with Schlick's term, of α = 0.1."""
    shape, probes = shape_of(lobe(None)), probe_directions()
    toward = (microfacet.unit(probes.wi + probes.wo) * probes.wo).sum(axis=1)
    brdf = microfacet.ggx(probes.wi, probes.wo, 0.1) * (0.5 + 0.1 * microfacet.schlick(toward))
    values = brdf[:, None] * np.ones(3)
    assert angle_errors(values, shape_values(shape, probes), probes).mean() < 0.02
    energy = [(v / probes.density[:, None]).sum() for v in (shape_values(shape, probes), values)]
    assert energy[0] == pytest.approx(energy[1], rel=0.01)


def test_a_matte_lobe_of_an_older_bake_is_matte():
    shape = shape_of(lobe(None, 0.0, ((0.5, 0.2, 0.0), (0.1, 0.0, 0.3))))
    assert shape.matte == pytest.approx(np.array([[0.5, 0.2, 0.0], [0.1, 0.0, 0.3]]), abs=1e-5)
    assert not shape.has_gaussians
