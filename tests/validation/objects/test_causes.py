"""Causes of error between truths with known differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsibr.validation.objects.causes import Truths, causes_of
from tests.validation.doubles import noisy_reference, smooth_map


@pytest.fixture
def truths(rng):
    """Shadows take 20 %, bounces give back 10 % of the light; one map errs by 5 %; pixels of one row are bent."""
    truth = smooth_map()
    made = {
        name: noisy_reference(truth * np.float32(factor), 0.01, rng)
        for name, factor in {"open": 1, "one_map": 1.05, "shadowed": 0.8, "full": 0.88, "all_over": 1}.items()
    }
    bent = np.zeros(truth.shape[:2], dtype=np.float32)
    bent[16] = 0.25
    made["shadowed"].buffers[:, 16] *= 2
    return Truths(**made, bent=bent)


def test_each_cause_is_measured_alone(truths):
    found = {cause.name: cause.rel_mse for cause in causes_of(truths)}
    near = 0.93  # of the relative error, for the softened denominator
    assert found["perspective"].value == pytest.approx(near * 0.05**2, rel=0.1)
    assert found["visibility"].value == pytest.approx(near * 0.25**2, rel=0.1)  # not 2× at the bent row
    assert found["visibility and bounces"].value == pytest.approx(near * (0.12 / 0.88) ** 2, rel=0.1)
    assert found["bent normals"].value == pytest.approx(near * (0.6 / 1.6) ** 2, rel=0.1)
    assert found["antialiasing"].ci95[0] < 0 < found["perspective"].ci95[0]


def test_without_bent_normals_there_is_no_such_cause(truths):
    plain = replace(truths, bent=np.zeros_like(truths.bent))
    assert "bent normals" not in {cause.name for cause in causes_of(plain)}
    assert list(plain.named) == ["open", "one_map", "shadowed", "full", "all_over"]
