import numpy as np
import pytest


@pytest.fixture
def image(rng):
    """Small panorama of random values."""
    return rng.random((12, 24, 3)).astype(np.float32)
