"""The folders that come with the project, in a checkout and in an installed package."""

from __future__ import annotations

import pytest

from rsibr import resources
from rsibr.errors import MachineError


def test_checkout():
    assert (resources.scenes() / "environments" / "city.exr").is_file()
    assert resources.configs().is_dir()


def test_installed_package_comes_first(tmp_path, monkeypatch):
    (tmp_path / "rsibr" / "_data" / "scenes").mkdir(parents=True)
    (tmp_path / "scenes").mkdir()
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path / "rsibr")
    assert resources.scenes() == tmp_path / "rsibr" / "_data" / "scenes"


def test_a_broken_installation_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path / "rsibr")
    with pytest.raises(MachineError, match="the installation lacks the folder 'configs'"):
        resources.configs()
