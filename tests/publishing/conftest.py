"""Fixtures of the page's tests."""

import pytest

from tests.browser import started


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium, one for the session; see `tests.browser`."""
    with started() as running:
        yield running
