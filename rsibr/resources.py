"""Folders of the shipped scenes and configs, in a checkout or in the installed package."""

from __future__ import annotations

from pathlib import Path

from rsibr.errors import MachineError

_PACKAGE = Path(__file__).resolve().parent


def scenes() -> Path:
    """Folder of the environments, materials and objects shipped with rsibr.

    Raises
    ------
    MachineError
        If the installation lacks it.
    """
    return _folder("scenes")


def configs() -> Path:
    """Folder of the configs shipped with rsibr, such as `demo.toml`.

    Raises
    ------
    MachineError
        If the installation lacks it.
    """
    return _folder("configs")


def _folder(name: str) -> Path:
    places = (_PACKAGE / "_data" / name, _PACKAGE.parent / name)
    for place in places:
        if place.is_dir():
            return place
    raise MachineError(
        f"the installation lacks the folder '{name}'",
        where=str(places[0]),
        fix="install rsibr again",
    )
