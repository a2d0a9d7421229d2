"""Fixtures that all tests share: the backend, random numbers, and small environments with known content."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rsibr import backend
from rsibr.scene.trial import IN_TRIAL
from tests.browser import started
from tests.scene.maps import asymmetric, gradient, write_exr


@pytest.fixture(scope="session", autouse=True)
def variant() -> str:
    """Set the Mitsuba variant of this machine, once."""
    return backend.use()


@pytest.fixture(autouse=True)
def _as_in_a_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """Load plugins straight away: a trial of each takes a second. `tests/scene/test_trial.py` takes this back."""
    monkeypatch.setenv(IN_TRIAL, "1")


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in each run."""
    return np.random.default_rng(20261122)


@pytest.fixture(scope="session")
def gradient_axis() -> NDArray[np.float64]:
    """Return the a of `gradient_sky`; |a| < 1, so that its radiance stays positive."""
    return np.array([0.3, 0.6, -0.2])


@pytest.fixture(scope="session")
def gradient_sky(tmp_path_factory: pytest.TempPathFactory, gradient_axis: NDArray[np.float64]) -> Path:
    """EXR of the environment L(ω) = 1 + a·ω with a = `gradient_axis`, in all three channels."""
    return write_exr(tmp_path_factory.mktemp("gradient") / "gradient.exr", gradient(gradient_axis))


@pytest.fixture(scope="session")
def asymmetric_environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """EXR with four smooth lights of different colours, which shows every turn and mirroring."""
    return write_exr(tmp_path_factory.mktemp("asymmetric") / "asymmetric.exr", asymmetric())


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Return a headless Chromium; one for all tests, since Playwright starts only once in a thread."""
    with started() as running:
        yield running
