"""A shell, a small config and a small bake."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rsibr.baking.baker import bake
from tests.cli.command import CONFIG, Shell, write_config
from tests.scene.maps import write_exr

MAP_CONFIG = CONFIG.replace('emitter = {type = "constant", radiance = 0.5}', 'file = "sky.exr"')


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """Return a function that runs `rsibr`."""
    return Shell(monkeypatch, capsys)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """Return the path of a small config."""
    return write_config(tmp_path)


@pytest.fixture(scope="session")
def _baked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("baked")
    write_exr(folder / "sky.exr", np.full((4, 8, 3), 0.5))
    bake(write_config(folder, MAP_CONFIG), out=folder / "small.rsibr")
    return folder


@pytest.fixture
def baked(_baked: Path, tmp_path: Path) -> Path:
    """Return a small bake of one's own, under the map `sky.exr` of the folder that `_baked` made."""
    return Path(shutil.copytree(_baked / "small.rsibr", tmp_path / "small.rsibr"))


@pytest.fixture
def sky(_baked: Path) -> Path:
    """Return the environment map that `baked` was made under."""
    return _baked / "sky.exr"
