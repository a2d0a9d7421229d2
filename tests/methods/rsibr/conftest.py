"""The light of the tests of the model."""

import pytest

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from tests.light.test_environment_pyramid import picture
from tests.microfacet import soft_sky


@pytest.fixture(scope="module")
def light():
    """A soft sky: its pyramid, and itself."""
    image = picture(soft_sky, 256)
    return EnvironmentPyramid.of(image), Light(image)
