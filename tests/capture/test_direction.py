"""Directions of any length, and what is none."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.capture.direction import unit
from rsibr.errors import InputError


@pytest.mark.parametrize("scale", [1e-300, 1e-9, 1.0, 1e300])
def test_any_length(scale):
    assert unit(scale * np.array([0.3, -0.4, 0]), "view") == pytest.approx([0.6, -0.8, 0], rel=1e-12)


@pytest.mark.parametrize("wrong", [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0), (1, 2), (), ((1, 2, 3),)])
def test_no_direction(wrong):
    with pytest.raises(InputError, match="is no direction"):
        unit(wrong, "view")
