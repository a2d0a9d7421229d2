"""Fixtures that all tests share."""

import numpy as np
import pytest

from rsibr import backend


@pytest.fixture(scope="session", autouse=True)
def variant():
    """The Mitsuba variant of this machine, set once."""
    return backend.use()


@pytest.fixture
def rng():
    """Random numbers, the same in each run."""
    return np.random.default_rng(20261122)
